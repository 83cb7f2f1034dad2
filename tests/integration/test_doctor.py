"""`twinscrew doctor --listen` on a boat that is under way: real sockets, simulated sensors."""

import threading
import time

import numpy as np
import pytest
from tests.harness.commands import as_json, twinscrew

from twinscrew.hil_sim.drivers.processes import free_port
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.navigation import Navigation
from twinscrew.hil_sim.supervisor import Supervisor
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr

pytestmark = pytest.mark.realtime

LISTEN_S = 3


class Sensors:
    """The LiDAR, and odometry or GPS and IMU, of a boat in a turn, in real time."""

    def __init__(self, endpoint, source):
        self.bus = ZenohBus(ZenohSettings(listen=(endpoint,), connect=()), "wamv1")
        self.world = make_world(load_scenario("crossing"), sensor="vrx16")
        self.supervisor = Supervisor(self.world)
        self.navigation = Navigation(self.world) if source == "gps_imu" else None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self):
        begin_s, tick = time.monotonic(), 0
        while not self._stop.wait(max(0.0, begin_s + 0.05 * tick - time.monotonic())):
            self.supervisor.advance(0.05, np.array([[900.0, 500.0]] * 2))
            if self.navigation is None:
                self.bus.publish("odometry", cdr.encode_odometry(self.world.odometry(0)))
            else:
                for sensed in self.navigation.take():
                    if sensed.vessel == 0:
                        self.bus.publish(sensed.topic, sensed.payload)
            if tick % 2 == 0:
                self.bus.publish("points", cdr.encode_point_cloud(self.world.cloud(0)))
            tick += 1

    def close(self):
        self._stop.set()
        self._thread.join()
        self.bus.close()


@pytest.fixture(params=["bus", "gps_imu"])
def sensors(tmp_path, request):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    (tmp_path / "boat.toml").write_text(
        f'name = "wamv1"\nsensor = "vrx16"\nodometry_source = "{request.param}"\n'
        f'[bus]\nconnect = ["{endpoint}"]\n'
        '[autopilot]\nconnection = "udpin:127.0.0.1:0"\n'
    )
    sensors = Sensors(endpoint, request.param)
    yield sensors
    sensors.close()


def test_it_judges_what_a_boat_says_and_misses_the_autopilot(sensors, tmp_path):
    words = ("doctor", "--config", tmp_path / "boat.toml", "--listen", LISTEN_S, "--json")
    done = twinscrew(*words)
    lines = {line["what"]: line for line in as_json(done)["checks"]}
    assert done.returncode == 1
    assert [what for what, line in lines.items() if line["verdict"] == "FAIL"] == ["autopilot"]
    assert lines["network"]["verdict"] == "OK"
    assert lines["cloud and sensor"]["verdict"] == "OK"
    assert lines["odometry's motion"]["verdict"] == "OK"
    assert "longest silence" in lines["points"]["found"]
    assert "scans are stamped" in lines["stamps"]["found"]
    assert lines["odometry's attitude"]["verdict"] == "OK"
    assert ("gps" in lines) == ("imu" in lines) == (sensors.navigation is not None)
    assert all(line["advice"] for line in lines.values() if line["verdict"] != "OK")

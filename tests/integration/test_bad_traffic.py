"""`twinscrew run` and a sender that sends rubbish: it is refused by name, and the boat goes on."""

from contextlib import closing
from pathlib import Path

import pytest
from tests.harness.boat import cloud
from tests.harness.commands import running, stop
from tests.harness.sensors import Sensors
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.processes import free_port
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr

pytestmark = pytest.mark.slow

RUBBISH = (b"", b"\x00", bytes(64), b"\xff" * 5000, cdr.encode_point_cloud(cloud(0.0))[:-3])


def test_malformed_and_oversized_messages_are_refused_by_name_and_good_ones_still_used(
    tmp_path: Path,
) -> None:
    endpoint, log = f"tcp/127.0.0.1:{free_port()}", tmp_path / "log.txt"
    config = tmp_path / "boat.toml"
    config.write_text(
        f'[autopilot]\nconnection = "udpin:127.0.0.1:0"\n'
        f'[bus]\nconnect = ["{endpoint}"]\nmax_message_mb = 0.02\n'
    )
    settings = ZenohSettings(listen=(endpoint,), connect=(), shared_memory=False)
    with (
        closing(ZenohBus(settings, "wamv")) as bus,
        running("run", "--config", config, log=log) as runtime,
    ):
        sensors = Sensors(bus)
        wait_until(lambda: bus.wait_for_subscribers(("points", "odometry", "goal"), 0.1))
        for topic in ("points", "odometry", "goal"):
            for payload in RUBBISH:
                bus.publish(topic, payload)
            sensors.wait_for_event("bad_message", f"{topic}: ")
        for size in (30_000, 300_000):  # above the limit; above what Zenoh puts together
            bus.publish("points", bytes(size))
        bus.publish("points", b"")
        sensors.wait_for_event("messages_missing", "1 points too large")
        sensors.measure_until_decided(3)
        assert stop(runtime) == 0
    assert "Traceback" not in log.read_text()

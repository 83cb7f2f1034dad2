"""The physics ports of several ArduPilots, and the world that waits for them."""

import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from tests.harness.ardupilot_peer import Sensors, whole_line

from twinscrew.hil_sim.bridges.ardupilot_fleet import ArduPilotFleet, ArduPilotSettings
from twinscrew.hil_sim.bridges.ardupilot_json import ServoFrame, encode_servos
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import World, make_world
from twinscrew.runtime.errors import LinkError

FIRST = 230
"""An instance number that no other test uses."""


class Harbour:
    """Two vessels, their fleet, and the sockets of two ArduPilots."""

    def __init__(self, folder: Path, silent_s: float = 15.0) -> None:
        self.words: list[str] = []
        self.world: World = make_world(load_scenario("random", 2, 0, 1), seed=1)
        settings = ArduPilotSettings(first_instance=FIRST, silent_s=silent_s)
        folders = [folder / "wamv1", folder / "wamv2"]
        self.fleet = ArduPilotFleet(self.world, folders, settings, self.words.append)
        self.sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in folders]
        for i, ardupilot in enumerate(self.sockets):
            ardupilot.connect(("127.0.0.1", 9002 + 10 * (FIRST + i)))
            ardupilot.setblocking(False)

    def ask(self, vessel: int, count: int, left_us: int = 1500, right_us: int = 1500) -> None:
        pwm_us = (left_us, 1500, right_us, *[1500] * 13)
        self.sockets[vessel].send(encode_servos(ServoFrame(100, count, pwm_us)))

    def answers(self, vessel: int) -> list[Sensors]:
        found = []
        while True:
            try:
                found.append(Sensors(whole_line(self.sockets[vessel].recv(65_000))))
            except BlockingIOError:
                return found

    def step(self) -> None:
        self.world.advance(0.01, self.fleet.thrust_N())

    def close(self) -> None:
        self.fleet.close()
        for ardupilot in self.sockets:
            ardupilot.close()


@pytest.fixture
def harbour(tmp_path):
    made = Harbour(tmp_path)
    yield made
    made.close()


def test_before_anyone_is_heard_the_propellers_stand_still_and_nobody_waits(harbour) -> None:
    harbour.step()
    harbour.fleet.wait(time.monotonic())
    assert harbour.fleet.thrust_N().tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_outputs_1_and_3_are_the_propellers_of_the_vessel_that_asked(harbour) -> None:
    harbour.ask(1, 0, left_us=2000, right_us=1250)
    harbour.fleet.wait(time.monotonic() + 0.05)
    assert harbour.fleet.thrust_N().tolist() == [[0.0, 0.0], [1000.0, -250.0]]


def test_each_is_told_of_its_own_vessel(harbour) -> None:
    for vessel in (0, 1):
        harbour.ask(vessel, 0)
    harbour.fleet.wait(time.monotonic() + 0.05)
    assert harbour.answers(0) == harbour.answers(1) == []
    harbour.step()
    for vessel in (0, 1):
        threading.Timer(0.05, harbour.ask, (vessel, 1)).start()
    harbour.fleet.wait(time.monotonic())  # until both have asked for what the world has not got
    for vessel in (0, 1):
        (told,) = harbour.answers(vessel)
        assert told.position == pytest.approx(harbour.world.state.position_N[vessel], rel=1e-5)
        assert told.time_s == pytest.approx(0.01)
    assert not np.allclose(*harbour.world.state.position_N)


def test_one_that_asks_no_more_ends_the_run_by_its_name(tmp_path) -> None:
    harbour = Harbour(tmp_path, silent_s=0.3)
    try:
        harbour.ask(1, 0)
        harbour.fleet.wait(time.monotonic() + 0.05)
        harbour.step()
        with pytest.raises(LinkError, match=rf"instance {FIRST + 1} asks for no physics any more"):
            harbour.fleet.wait(time.monotonic())
    finally:
        harbour.close()


def test_rubbish_is_not_answered(harbour) -> None:
    harbour.sockets[0].send(b"\x1a\x48 hello")
    harbour.step()
    harbour.fleet.wait(time.monotonic() + 0.05)
    assert harbour.answers(0) == []
    assert harbour.fleet.thrust_N().tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_command_lines_are_told_one_a_vessel(harbour) -> None:
    _, first, second = harbour.words
    assert f"--instance {FIRST} --sysid 1 " in first
    assert f"--instance {FIRST + 1} --sysid 2 " in second


def test_parameters_are_the_shipped_ones_with_the_vessels_own_id(harbour, tmp_path) -> None:
    lines = (tmp_path / "wamv2" / "ardurover.parm").read_text().splitlines()
    values = dict(line.split() for line in lines)
    assert values["SYSID_THISMAV"] == values["SYSID_MYGCS"] == "2"
    assert values["FRAME_CLASS"] == "2"
    assert values["FS_TIMEOUT"] == "1.5"


def test_a_port_that_is_in_use_is_refused_and_nothing_stays_open(harbour, tmp_path) -> None:
    with pytest.raises(LinkError, match=f"UDP port {9002 + 10 * FIRST}: Address already in use"):
        Harbour(tmp_path / "again")
    assert harbour.fleet.connection(0) == f"tcp:127.0.0.1:{5760 + 10 * FIRST}"

"""An autopilot in a process of its own: it answers, dies, and comes back without memory."""

import signal
from collections.abc import Iterator

import pytest
from tests.harness.boat import odometry
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.faults.remote_autopilot import SIGNAL_LOST_S, RemoteAutopilot
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.mavlink import Wire

TICK_S = 0.05


class Bench:
    """The real link, and an autopilot elsewhere; time goes on as the test says."""

    def __init__(self) -> None:
        self.autopilot = RemoteAutopilot(1)
        self.link = AutopilotLink(AutopilotSettings(arm=True, receiver_fitted=False))
        self.now_s = 0.0

    def tick(self, thrust=(300.0, 200.0)) -> None:
        self.now_s += TICK_S
        self.autopilot.receive(self.link.command(thrust, self.now_s), self.now_s)
        self.autopilot.receive(self.link.tick(self.now_s), self.now_s)
        said = self.autopilot.step(self.now_s, odometry(self.now_s))
        self.link.receive(said, self.now_s)

    def drives(self) -> bool:
        self.tick((0.0, 0.0) if not self.link.status.engaged else (300.0, 200.0))
        return bool(self.autopilot.thrust_command_N().all())

    def is_answered(self) -> bool:
        before = self.autopilot.bridge
        self.tick()
        return self.autopilot.bridge is not before


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.autopilot.close()


def test_ctrl_c_in_the_simulators_terminal_is_not_for_it(bench: Bench) -> None:
    wait_until(bench.drives)
    bench.autopilot.signal(signal.SIGINT)
    for _ in range(5):  # the first may have been on its way
        wait_until(bench.is_answered)


def test_it_arms_drives_and_shows_its_mode(bench: Bench) -> None:
    wait_until(bench.drives)
    assert bench.autopilot.thrust_command_N() == pytest.approx([300.0, 200.0], abs=3.0)
    assert bench.autopilot.bridge.mode == "MANUAL"
    assert bench.autopilot.bridge.armed


def test_a_pilot_can_take_it(bench: Bench) -> None:
    wait_until(bench.drives)
    bench.autopilot.act("hold")
    wait_until(lambda: bench.tick() or bench.autopilot.bridge.mode == "HOLD")
    wait_until(lambda: bench.tick() or not bench.autopilot.thrust_command_N().any())
    bench.autopilot.act("disarm")
    wait_until(lambda: bench.tick() or not bench.autopilot.bridge.armed)


def test_a_parameter_can_be_set(bench: Bench) -> None:
    wait_until(bench.drives)
    bench.autopilot.set_parameter("SYSID_MYGCS", 250.0)
    wait_until(lambda: bench.tick() or not bench.autopilot.thrust_command_N().any())


@pytest.mark.slow
def test_killed_it_is_silent_and_comes_back_disarmed(bench: Bench) -> None:
    wait_until(bench.drives)
    bench.autopilot.kill()
    until_s = bench.now_s + SIGNAL_LOST_S + 2 * TICK_S
    while bench.now_s < until_s:
        bench.tick()
    assert not bench.autopilot.thrust_command_N().any()
    bench.autopilot.start()
    wait_until(lambda: bench.tick() or not bench.autopilot.bridge.armed)
    assert bench.autopilot.bridge.mode == "MANUAL"


def test_what_a_pilot_did_while_it_could_not_hear_is_done_when_it_can(bench: Bench) -> None:
    wait_until(bench.drives)
    bench.autopilot.signal(signal.SIGSTOP)
    for _ in range(2000):  # far more than waits in a socket
        bench.tick()
    bench.autopilot.act("hold")
    bench.tick()
    bench.autopilot.signal(signal.SIGCONT)
    wait_until(lambda: bench.tick() or bench.autopilot.bridge.mode == "HOLD")


def test_stopped_it_goes_on_where_it_was(bench: Bench) -> None:
    wait_until(bench.drives)
    bench.autopilot.signal(signal.SIGSTOP)
    for _ in range(10):
        bench.tick()
    assert not bench.autopilot.thrust_command_N().any()
    bench.autopilot.signal(signal.SIGCONT)
    wait_until(bench.drives)
    assert bench.autopilot.bridge.armed


def test_somebody_may_set_the_rate_of_all_its_streams(bench: Bench) -> None:
    heard, wire = [], Wire(1, 191)

    def said(kind: str) -> list[int]:
        bench.now_s += TICK_S
        heard.extend(wire.decode(bench.autopilot.step(bench.now_s, odometry(bench.now_s))))
        return [m.time_boot_ms for m in heard if m.get_type() == kind]

    wait_until(lambda: len(said("RC_CHANNELS")) > 3)
    bench.autopilot.request_streams(5.0)
    wait_until(lambda: len(said("RC_CHANNELS")) > 10)
    *_, before_ms, last_ms = said("RC_CHANNELS")
    assert last_ms - before_ms == pytest.approx(200, abs=51)

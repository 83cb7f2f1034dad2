"""The real-time loop, by a clock that the test turns."""

import time

import numpy as np
import pytest
from tests.harness.boat import Boat, cloud, odometry

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.runtime.app.loop import Loop
from twinscrew.runtime.app.outlet import Outlet
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.bus.memory import MemoryBus
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.carrier import Transport
from twinscrew.runtime.messages import cdr

SCAN_S = 0.1


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class Line(Transport):
    """A connection to the simulated autopilot, which may break."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.broken, self.sends = clock, False, []
        self.autopilot = RoverAutopilot(RoverAutopilotSettings(), 1, boot_s=clock.now_s)

    def fileno(self) -> int:
        return -1

    def receive(self) -> bytes:
        if self.broken:
            raise LinkError("the device is gone")
        return self.autopilot.step(self.clock.now_s)

    def send(self, data: bytes) -> None:
        if self.broken:
            raise LinkError("the device is gone")
        self.sends.append(self.clock.now_s)
        self.autopilot.receive(data, self.clock.now_s)

    def close(self) -> None:
        pass


class Sensors:
    """An inbox that turns the clock on while the loop waits, and hands out what is due."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.next_s, self.age_ms, self.hold_s = clock, clock.now_s, 0.0, 0.0

    def wait(self, timeout_s: float) -> list[Received]:
        until_s = self.clock.now_s + max(0.0, timeout_s)
        if self.next_s > until_s:
            self.clock.now_s = until_s
            return []
        self.clock.now_s = max(self.clock.now_s, self.next_s) + self.hold_s
        time_s, self.next_s = self.next_s, self.next_s + SCAN_S
        received_ns = time.monotonic_ns() - round(self.age_ms * 1e6)
        return [
            Received("odometry", cdr.encode_odometry(odometry(time_s)), received_ns),
            Received("points", cdr.encode_point_cloud(cloud(time_s)), received_ns, 1),
        ]


class Rig:
    def __init__(self) -> None:
        self.clock = Clock()
        self.line, self.sensors = Line(self.clock), Sensors(self.clock)
        self.bus, self.events, self.thrusts = MemoryBus("wamv"), [], []
        self.bus.subscribe("diagnostics", self._hear)
        self.bus.subscribe("thrust_left", lambda m: self.thrusts.append(m.payload))
        self.outlet = Outlet(self.bus, None)
        self.loop = Loop(
            Boat().controller, self.sensors, self.line, self.outlet, rate_hz=20.0, clock=self.clock
        )

    def run(self, seconds: float) -> "Rig":
        until_s = self.clock.now_s + seconds
        self.loop.run(lambda: self.clock.now_s >= until_s)
        return self

    @property
    def names(self) -> list[str]:
        return [event.name for event in self.events]

    def _hear(self, message: Received) -> None:
        self.events += cdr.decode_diagnostics(message.payload)


def test_it_sails_and_every_decision_is_told_and_timed() -> None:
    rig = Rig().run(5.0)
    assert rig.line.autopilot.rover.armed
    assert rig.outlet.decisions == pytest.approx(50, abs=1)
    assert rig.loop.latencies.summary().count == rig.outlet.decisions
    assert rig.loop.wire_latencies.summary().count == rig.outlet.decisions
    assert max(cdr.decode_thrust(payload) for payload in rig.thrusts) > 100.0


def test_commands_go_out_twenty_times_a_second_without_drift() -> None:
    rig = Rig()
    rig.sensors.next_s = np.inf
    rig.run(60.0)
    sends = np.array(rig.line.sends[:-1])
    assert len(sends) == pytest.approx(1200, abs=1)
    np.testing.assert_allclose(sends, 100.0 + 0.05 * np.arange(len(sends)), atol=1e-6)
    assert rig.loop.missed_ticks == 0


def test_a_loop_that_was_held_up_drops_ticks_and_keeps_the_grid() -> None:
    rig = Rig()
    rig.sensors.hold_s = 0.27
    rig.run(3.0)
    rig.sensors.hold_s, rig.sensors.next_s = 0.0, np.inf
    rig.line.sends.clear()
    rig.run(1.0)
    phase = np.array(rig.line.sends[1:-1]) / 0.05 % 1.0
    assert len(phase) > 15
    assert rig.loop.missed_ticks > 5
    assert any("missed" in event.detail for event in rig.events if event.name == "overrun")
    np.testing.assert_allclose(np.minimum(phase, 1.0 - phase), 0.0, atol=1e-6)


def test_what_came_before_the_first_turn_is_no_missed_tick() -> None:
    rig = Rig()
    rig.clock.now_s += 3.0
    rig.sensors.next_s = rig.clock.now_s
    rig.run(1.0)
    assert rig.loop.missed_ticks == 0


def test_it_leaves_the_propellers_at_rest() -> None:
    rig = Rig().run(5.0)
    rig.line.autopilot.step(rig.clock.now_s)
    assert rig.line.autopilot.rover.armed
    assert rig.line.autopilot.thrust_command_N().tolist() == [0.0, 0.0]


def test_a_decision_that_comes_too_late_is_counted_told_and_degrades() -> None:
    rig = Rig().run(5.0)
    rig.sensors.age_ms = 250.0
    rig.run(1.0)
    assert rig.loop.overruns == pytest.approx(10, abs=1)
    assert "overrun" in rig.names
    details = [event.detail for event in rig.events if event.name == "state"]
    assert "active -> degraded" in details


def test_a_connection_that_breaks_is_told_once_and_the_loop_goes_on() -> None:
    rig = Rig().run(5.0)
    rig.line.broken = True
    before = rig.outlet.decisions
    rig.run(2.0)
    assert rig.names.count("link_down") == 1
    assert rig.outlet.decisions > before + 15
    assert "autopilot_silent" in rig.names
    assert cdr.decode_thrust(rig.thrusts[-1]) == 0.0
    assert "link_restored" not in rig.names


def test_a_connection_that_comes_back_is_told_once_and_each_new_break_again() -> None:
    rig = Rig().run(5.0)
    for times in (1, 2):
        rig.line.broken = True
        rig.run(1.0)
        rig.line.broken = False
        rig.run(5.0)
        assert rig.names.count("link_down") == rig.names.count("link_restored") == times
    assert cdr.decode_thrust(rig.thrusts[-2]) > 0.0


def test_messages_that_the_bus_threw_away_are_told_once_and_degrade(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = Rig().run(5.0)
    assert "messages_missing" not in rig.names
    monkeypatch.setattr(MemoryBus, "missing", {"points too large": 3})
    rig.run(3.0)
    told = [event.detail for event in rig.events if event.name == "messages_missing"]
    assert told == ["3 points too large"]
    assert "active -> degraded" in [e.detail for e in rig.events if e.name == "state"]


def test_the_garbage_collector_is_left_as_it_was() -> None:
    import gc

    frozen = gc.get_freeze_count()
    Rig().run(0.5)
    assert gc.get_freeze_count() == frozen

"""The physics of one ArduPilot, in lock-step: frames are answered when the world is there."""

from itertools import pairwise

import pytest
from tests.harness.ardupilot_peer import Sensors, whole_line

from twinscrew.hil_sim.bridges.ardupilot_json import ServoFrame, encode_servos
from twinscrew.hil_sim.bridges.backend import JsonBackend
from twinscrew.hil_sim.bridges.inertial import Moment

STEP_S = 0.01


def at(step: int) -> Moment:
    """A boat that goes north with 2 m/s."""
    time_s = step * STEP_S
    return Moment(time_s, (2.0 * time_s, 0, 0), (1, 0, 0, 0), (2.0, 0, 0), (0, 0, 0))


def frame(count: int, rate_hz: int = 400, pwm_us: int = 1500) -> bytes:
    return encode_servos(ServoFrame(rate_hz, count, (pwm_us,) * 16))


class Lockstep:
    """ArduPilot's side: asks, and asks for the next frame when it has the answer."""

    def __init__(self, rate_hz: int, begin_step: int = 0) -> None:
        self.rate_hz = rate_hz
        self.backend = JsonBackend(at(begin_step))
        self.step = begin_step
        self.count = 0
        self.told: list[Sensors] = []
        self.backend.receive(frame(0, rate_hz))

    def sail(self, steps: int) -> "Lockstep":
        for _ in range(steps):
            self.step += 1
            self.backend.move(at(self.step))
            while answer := self.backend.answer():
                self.told.append(Sensors(whole_line(answer)))
                self.count += 1
                self.backend.receive(frame(self.count, self.rate_hz))
        return self


def test_before_the_world_moves_no_frame_is_answered() -> None:
    backend = JsonBackend(at(0))
    backend.receive(frame(0))
    assert backend.answer() == b""
    assert backend.caught_up


@pytest.mark.parametrize("rate_hz", [50, 100, 200, 333, 400, 1200])
def test_as_many_frames_are_answered_as_ardupilot_wants_a_second(rate_hz: int) -> None:
    ardupilot = Lockstep(rate_hz).sail(200)
    assert len(ardupilot.told) == pytest.approx(2 * rate_hz, abs=1)


@pytest.mark.parametrize("rate_hz", [50, 100, 333, 1200])
def test_time_moves_on_by_one_frame_each(rate_hz: int) -> None:
    times = [0.0, *(sensors.time_s for sensors in Lockstep(rate_hz).sail(50).told)]
    steps = [b - a for a, b in pairwise(times)]
    assert steps == pytest.approx([1 / rate_hz] * len(steps), abs=2e-9)


def test_frames_between_the_worlds_steps_see_motion_between_them() -> None:
    told = Lockstep(400).sail(3).told
    assert [s.position[0] for s in told] == pytest.approx([2.0 * s.time_s for s in told], abs=1e-6)
    assert len({s.position[0] for s in told}) == 12


@pytest.mark.parametrize("rate_hz", [0, 1, 65_535])
def test_whatever_rate_is_asked_for_a_frame_is_one_that_ardupilot_takes(rate_hz: int) -> None:
    times = [0.0, *(sensors.time_s for sensors in Lockstep(rate_hz).sail(30).told)]
    steps = [b - a for a, b in pairwise(times)]
    assert steps
    assert all(0.0 < step < 0.1 for step in steps)


def test_its_time_begins_at_zero_whenever_it_is_switched_on() -> None:
    assert Lockstep(100, begin_step=5000).sail(1).told[0].time_s == pytest.approx(0.01)


def test_a_frame_that_is_asked_for_again_gets_the_same_answer_and_costs_no_time() -> None:
    backend = JsonBackend(at(0))
    backend.receive(frame(7))
    backend.move(at(1))
    first = backend.answer()
    backend.receive(frame(7))
    assert backend.answer() == first != b""
    backend.receive(frame(8))
    assert Sensors(whole_line(backend.answer())).time_s == pytest.approx(2 / 400)


def test_a_frame_that_waits_may_be_asked_for_again() -> None:
    backend = JsonBackend(at(0))
    backend.receive(frame(0))
    backend.receive(frame(0))
    backend.move(at(1))
    assert backend.answer()
    assert backend.answer() == b""


def test_a_count_that_goes_back_is_a_restart_and_the_boat_stays_where_it_is() -> None:
    ardupilot = Lockstep(100).sail(100)
    assert ardupilot.backend.restarts == 0
    ardupilot.count = 0
    ardupilot.backend.receive(frame(0, 100))
    ardupilot.sail(1)
    assert ardupilot.backend.restarts == 1
    assert ardupilot.told[-1].time_s == pytest.approx(0.01)
    assert ardupilot.told[-1].position[0] == pytest.approx(2.0 * 1.01)


def test_what_is_no_frame_changes_nothing_but_a_count() -> None:
    backend = JsonBackend(at(0))
    backend.receive(frame(0, pwm_us=1700))
    assert not backend.receive(b"rubbish")
    assert backend.pwm_us == (1700,) * 16
    assert backend.malformed == 1


def test_one_that_was_never_heard_holds_nobody_up() -> None:
    backend = JsonBackend(at(0))
    backend.move(at(1))
    assert backend.caught_up
    assert not backend.heard


def test_the_world_must_wait_until_it_asks_for_a_later_frame() -> None:
    backend = JsonBackend(at(0))
    backend.receive(frame(0, 100))
    backend.move(at(1))
    assert not backend.caught_up
    backend.answer()
    assert not backend.caught_up, "it has not asked again"
    backend.receive(frame(1, 100))
    assert backend.caught_up


def test_after_steps_that_it_slept_through_it_is_told_only_what_is_known() -> None:
    backend = JsonBackend(at(0))
    backend.receive(frame(0))
    backend.move(at(1))
    backend.answer()
    backend.move(at(5))
    backend.move(at(6))
    backend.receive(frame(1))
    assert Sensors(whole_line(backend.answer())).position[0] == pytest.approx(2.0 * 0.05)

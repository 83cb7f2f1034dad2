"""None"""

from __future__ import annotations

import numpy as np
import pytest
from tests.harness.boat import Steady, cloud, decided, make_pipeline, odometry, stamp

from twinscrew.runtime.errors import MessageError, PolicyError
from twinscrew.runtime.messages.types import Decision, Goal
from twinscrew.runtime.vessel.pipeline import DecisionSchedule, Pipeline


def sail(
    pipeline: Pipeline, first_s: float, last_s: float, *, engaged: bool = True
) -> list[Decision]:
    """Ten scans a second, the last one at `last_s`."""
    times = np.arange(first_s, last_s + 1e-6, 0.1)
    return [decided(pipeline, t, engaged=engaged) for t in times]


def thrusts(decisions: list[Decision]) -> list[list[float]]:
    return [decision.thrust.tolist() for decision in decisions]


def names(decisions: list[Decision]) -> list[str]:
    return [event.name for decision in decisions for event in decision.events]


def test_the_policy_is_asked_once_a_period_and_its_thrust_held_between() -> None:
    policy = Steady((100.0, -40.0))
    decisions = sail(make_pipeline(policy), 0.0, 1.4)
    assert policy.asked == 3
    assert [d.acted for d in decisions] == ([True] + [False] * 4) * 3
    assert thrusts(decisions[::5]) == [[50.0, -20.0], [100.0, -40.0], [150.0, -60.0]]
    assert thrusts(decisions[:5]) == [[50.0, -20.0]] * 5


def test_decisions_are_numbered_and_carry_the_scans_stamp() -> None:
    decisions = sail(make_pipeline(Steady()), 2.0, 2.3)
    assert [d.sequence for d in decisions] == [0, 1, 2, 3]
    assert [d.stamp_ns for d in decisions] == [stamp(t) for t in (2.0, 2.1, 2.2, 2.3)]


def test_thrust_integrates_no_farther_than_the_propellers_go() -> None:
    decisions = sail(make_pipeline(Steady((1000.0, -1000.0))), 0.0, 2.0)
    assert thrusts(decisions)[-1] == [1000.0, -500.0]


def test_a_thrust_at_its_limit_comes_back_at_once() -> None:
    policy = Steady((1000.0, 1000.0))
    pipeline = make_pipeline(policy)
    sail(pipeline, 0.0, 9.9)
    policy.rate = (-200.0, -200.0)
    assert thrusts(sail(pipeline, 10.0, 10.0)) == [[900.0, 900.0]]


def test_a_policy_sees_the_goal_and_its_own_thrust() -> None:
    decisions = sail(make_pipeline(Steady((100.0, 60.0)), ((30.0, 4.0),)), 0.0, 0.5)
    seen = decisions[-1].observation
    assert seen is not None
    assert seen.ego.tolist() == pytest.approx([30.0, 4.0, 0, 0, 0, 50.0, 30.0])
    assert decisions[-2].observation is None


def test_while_nobody_lets_it_drive_the_thrust_is_zero_and_the_policy_rests() -> None:
    policy = Steady()
    decisions = sail(make_pipeline(policy), 0.0, 2.0, engaged=False)
    assert policy.asked == 0
    assert not np.any(thrusts(decisions))


def test_losing_the_boat_and_getting_it_back_starts_from_zero_thrust_at_once() -> None:
    policy = Steady()
    pipeline = make_pipeline(policy)
    sail(pipeline, 0.0, 3.0)
    assert thrusts(sail(pipeline, 3.1, 3.1, engaged=False)) == [[0.0, 0.0]]
    (back,) = sail(pipeline, 3.2, 3.2)
    assert back.acted
    assert back.thrust.tolist() == [50.0, 50.0]


def test_on_arrival_the_thrust_is_zero_and_stays_so() -> None:
    policy = Steady()
    pipeline = make_pipeline(policy, ((10.0, 0.0),))
    sail(pipeline, 0.0, 1.0)
    there, _ = pipeline.step(cloud(1.1), odometry(1.1, north=8.5), engaged=True)
    assert (there.arrived, there.thrust.tolist()) == (True, [0.0, 0.0])
    assert names([there]) == ["goal_reached"]
    later = sail(pipeline, 1.2, 2.0)
    assert names(later) == []
    assert not np.any(thrusts(later))


def test_without_a_goal_it_says_so_once_and_waits_for_one() -> None:
    policy = Steady()
    pipeline = make_pipeline(policy, ())
    assert names(sail(pipeline, 0.0, 2.0)) == ["goal_missing"]
    assert policy.asked == 0
    pipeline.mission.set_goal(Goal(stamp_ns=stamp(2.0), position_N=np.array([40.0, 0.0])))
    assert thrusts(sail(pipeline, 2.1, 2.1)) == [[50.0, 50.0]]


def test_a_policy_that_fails_means_zero_thrust_and_is_asked_again_by_the_next_scan() -> None:
    policy = Steady()
    pipeline = make_pipeline(policy)
    sail(pipeline, 0.0, 0.9)
    policy.failure = PolicyError("it answered with NaN")
    failed = sail(pipeline, 1.0, 1.2)
    assert names(failed) == ["policy_error"] * 3
    assert failed[0].events[0].detail == "it answered with NaN"
    assert not np.any(thrusts(failed))
    policy.failure = None
    (well,) = sail(pipeline, 1.3, 1.3)
    assert well.events == ()
    assert well.thrust.tolist() == [50.0, 50.0]


def test_a_policy_that_answers_nan_trips_the_guard_and_recovers_next_period() -> None:
    policy = Steady((float("nan"), 0.0))
    pipeline = make_pipeline(policy)
    decisions = sail(pipeline, 0.0, 0.4)
    assert names(decisions) == ["guard_tripped"]
    assert not np.any(thrusts(decisions))
    policy.rate = (100.0, 100.0)
    assert thrusts(sail(pipeline, 0.5, 0.5)) == [[50.0, 50.0]]


def test_a_scan_that_cannot_be_processed_means_zero_thrust_and_no_objects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pipeline = make_pipeline(Steady())
    sail(pipeline, 0.0, 0.9)

    def fail(*args: object, **kwargs: object) -> None:
        raise MessageError("the kernel cannot use it")

    with monkeypatch.context() as patched:
        patched.setattr(pipeline.perception, "step", fail)
        (blind,) = sail(pipeline, 1.0, 1.0)
    assert names([blind]) == ["perception_error"]
    assert blind.thrust.tolist() == [0.0, 0.0]
    assert len(blind.objects.p_L) == 0
    assert thrusts(sail(pipeline, 1.1, 1.1)) == [[50.0, 50.0]]


def test_a_reset_forgets_tracks_thrust_and_the_policys_memory() -> None:
    policy = Steady()
    pipeline = make_pipeline(policy)
    sail(pipeline, 0.0, 2.0)
    pipeline.reset()
    assert policy.resets == 1
    assert thrusts(sail(pipeline, 2.1, 3.0)) == [[0.0, 0.0]] * 10
    assert thrusts(sail(pipeline, 3.1, 3.1)) == [[50.0, 50.0]]


def test_after_longer_blindness_than_tracks_are_kept_the_boat_stands_still_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pipeline = make_pipeline(Steady())
    sail(pipeline, 0.0, 0.9)

    def fail(*args: object, **kwargs: object) -> None:
        raise MessageError("the kernel cannot use it")

    with monkeypatch.context() as patched:
        patched.setattr(pipeline.perception, "step", fail)
        sail(pipeline, 1.0, 3.5)
    assert not np.any(thrusts(sail(pipeline, 3.6, 4.5)))
    assert np.any(thrusts(sail(pipeline, 4.6, 4.6)))


def test_after_a_gap_in_which_everything_was_forgotten_the_boat_stands_still_first() -> None:
    pipeline = make_pipeline(Steady())
    sail(pipeline, 0.0, 2.0)
    assert not np.any(thrusts(sail(pipeline, 12.0, 12.9)))
    assert np.any(thrusts(sail(pipeline, 13.0, 13.1)))


def test_a_slow_lidar_is_watched_for_as_many_scans_as_a_track_needs() -> None:
    pipeline = make_pipeline(Steady())
    pipeline.reset()
    at = [decided(pipeline, t) for t in np.arange(0.0, 3.0, 0.5)]
    assert [bool(np.any(decision.thrust)) for decision in at] == [False] * 4 + [True] * 2


def test_the_same_scans_give_the_same_decisions() -> None:
    first, second = (sail(make_pipeline(Steady((30.0, 70.0))), 0.0, 3.0) for _ in range(2))
    assert thrusts(first) == thrusts(second)


def test_a_gap_after_which_everything_is_forgotten_is_told() -> None:
    pipeline = make_pipeline(Steady())
    sail(pipeline, 0.0, 1.0)
    assert names(sail(pipeline, 11.0, 11.5)) == ["tracks_forgotten"]


# --

MS = 1_000_000


def due_times(stamps_ms: list[float]) -> list[float]:
    schedule = DecisionSchedule(0.5)
    return [t for t in stamps_ms if schedule.is_due(round(t * MS))]


def test_a_decision_is_due_at_once_and_then_every_period() -> None:
    assert due_times([100.0 * k for k in range(12)]) == [0, 500, 1000]


def test_jittering_stamps_do_not_drift() -> None:
    rng = np.random.default_rng(0)
    stamps = [100.0 * k + float(rng.uniform(-20, 20)) for k in range(1, 600)]
    due = due_times(stamps)
    assert len(due) == 120
    np.testing.assert_allclose(np.diff(due), 500, atol=80)


def test_a_slow_sensor_decides_on_every_scan() -> None:
    assert due_times([0, 700, 1400, 2100]) == [0, 700, 1400, 2100]


def test_after_a_gap_the_grid_starts_anew() -> None:
    assert due_times([0, 100, 3070, 3170, 3570]) == [0, 3070, 3570]


def test_a_restart_makes_the_next_stamp_due() -> None:
    schedule = DecisionSchedule(0.5)
    assert schedule.is_due(0)
    assert not schedule.is_due(100 * MS)
    schedule.restart()
    assert schedule.is_due(200 * MS)
    assert not schedule.is_due(300 * MS)

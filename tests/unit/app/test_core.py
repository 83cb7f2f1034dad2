import numpy as np
import pytest
from tests.harness.boat import FAR_AHEAD, Steady, cloud, make_pipeline, odometry, stamp

from twinscrew.runtime.app.core import Core, Outcome
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Engagement, Goal


class Dock:
    """A core, and short words for what it is fed."""

    def __init__(self, *, engaged: bool = True, waypoints_m=FAR_AHEAD):
        self.policy = Steady()
        self.core = Core(make_pipeline(self.policy, waypoints_m))
        self.engage(engaged)

    def engage(self, engaged: bool) -> Outcome:
        message = Engagement(stamp_ns=stamp(0), engaged=engaged)
        return self.core.feed("engagement", cdr.encode_engagement(message))

    def odometry(self, time_s: float, north: float = 0.0) -> Outcome:
        return self.core.feed("odometry", cdr.encode_odometry(odometry(time_s, north)))

    def scan(self, time_s: float) -> Outcome:
        return self.core.feed("points", cdr.encode_point_cloud(cloud(time_s)))

    def sail(self, first_s: float, last_s: float, north: float = 0.0) -> list[Outcome]:
        times = np.arange(first_s, last_s + 1e-6, 0.1)
        return [(self.odometry(t, north), self.scan(t))[1] for t in times]


def names(*outcomes: Outcome) -> list[str]:
    return [event.name for outcome in outcomes for event in outcome.events]


def thrusts(outcomes: list[Outcome]) -> list[list[float]]:
    return [outcome.decision.thrust.tolist() for outcome in outcomes]


def test_every_scan_with_odometry_is_a_decision() -> None:
    outcomes = Dock().sail(0.0, 1.0)
    assert [o.decision.stamp_ns for o in outcomes] == [stamp(t / 10) for t in range(11)]
    assert names(*outcomes) == []
    assert thrusts(outcomes)[-1] == [150.0, 150.0]


def test_a_core_that_was_not_engaged_gives_no_thrust() -> None:
    assert not np.any(thrusts(Dock(engaged=False).sail(0.0, 2.0)))


def test_a_scan_without_odometry_near_its_time_is_not_used() -> None:
    dock = Dock()
    early = dock.scan(0.0)
    dock.odometry(0.1)
    late = dock.scan(0.35)
    assert names(early, late) == ["odometry_missing"] * 2
    assert early.decision is None
    assert late.decision is None
    assert late.stamp_ns is None


@pytest.mark.parametrize("time_s", [1.0, 0.95, 0.2])
def test_a_scan_twice_or_late_is_dropped_and_no_sign_of_life(time_s: float) -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    late = dock.scan(time_s)
    assert names(late) == ["out_of_order"]
    assert (late.decision, late.stamp_ns) == (None, None)
    assert names(*dock.sail(1.1, 1.2)) == []


def test_odometry_twice_or_late_is_dropped_and_no_sign_of_life() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    twice, late = dock.odometry(1.0), dock.odometry(0.7)
    assert names(twice, late) == ["out_of_order"] * 2
    assert (twice.stamp_ns, late.stamp_ns) == (None, None)


@pytest.mark.parametrize("first", ["odometry", "scan"])
def test_a_clock_set_back_forgets_everything_and_goes_on_from_there(first: str) -> None:
    dock = Dock()
    dock.sail(100.0, 103.0)
    told = getattr(dock, first)(50.0)
    assert names(told) == (
        ["clock_back"] if first == "odometry" else ["clock_back", "odometry_missing"]
    )
    assert dock.policy.resets == 1
    assert dock.core.latest_ns == stamp(50.0)
    again = dock.sail(50.1, 51.3)
    assert names(*again) == []
    assert not np.any(thrusts(again)[:10])
    assert thrusts(again)[10] == [50.0, 50.0]


def test_one_stamp_from_the_far_future_costs_no_more_than_a_second() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    dock.odometry(1e6)
    dock.scan(1e6)
    assert names(dock.odometry(1.1)) == ["clock_back"]
    assert dock.scan(1.1).decision is not None
    again = dock.sail(1.2, 2.1)
    assert names(*again) == []
    assert np.any(thrusts(again)[-1])


def test_scans_of_which_every_second_is_stamped_ten_seconds_old_keep_the_boat_still() -> None:
    dock = Dock()
    assert np.any(thrusts(dock.sail(0.0, 2.0))[-1])
    for k in range(21, 60):
        dock.odometry(k / 10)
        outcome = dock.scan(k / 10 - (10.0 if k % 2 else 0.0))
        if k % 2:
            assert "clock_back" in names(outcome)
        assert outcome.decision is None or not np.any(outcome.decision.thrust)
        assert dock.core.is_settling


def test_after_a_jump_the_boat_stands_still_for_a_second() -> None:
    dock = Dock()
    dock.sail(0.0, 2.0)
    assert names(dock.odometry(2.1, north=40.0)) == ["odometry_jump"]
    outcomes = dock.sail(2.2, 3.4, north=40.0)
    moving = [bool(np.any(thrust)) for thrust in thrusts(outcomes)]
    assert moving == [False] * 10 + [True] * 3  # a second after the first scan, at 2.2 s
    assert thrusts(outcomes)[10] == [50.0, 50.0]


def test_a_position_that_jumps_to_and_fro_keeps_the_boat_still() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    for k in range(11, 40):
        dock.odometry(k / 10, north=40.0 * (k % 2))
        assert not np.any(dock.scan(k / 10).decision.thrust)


def test_a_boat_that_moves_as_boats_do_does_not_jump() -> None:
    dock = Dock()
    told = [dock.odometry(k / 20, north=8.0 * k / 20) for k in range(100)]
    assert names(*told) == []


def test_odometry_a_thousand_times_a_second_fits_scans_that_come_late() -> None:
    dock = Dock()
    for k in range(3000):
        dock.odometry(k / 1000)
        if k >= 200 and k % 100 == 0:
            outcome = dock.scan((k - 150) / 1000)
            assert outcome.decision is not None
    assert np.any(outcome.decision.thrust)


def test_a_goal_is_taken_and_told() -> None:
    dock = Dock(waypoints_m=())
    goal = Goal(stamp_ns=stamp(0), position_N=np.array([30.0, -4.0]))
    told = dock.core.feed("goal", cdr.encode_goal(goal))
    assert names(told) == ["goal_set"]
    assert told.events[0].detail == "north 30.0 m, east -4.0 m"
    assert dock.sail(0.0, 0.0)[0].decision.observation.ego[:2].tolist() == [30.0, -4.0]


@pytest.mark.parametrize("topic", ["points", "odometry", "goal", "engagement"])
@pytest.mark.parametrize("payload", [b"", b"\x00\x01\x00\x00", b"\xff" * 300])
def test_bytes_that_are_no_message_are_an_event(topic: str, payload: bytes) -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    told = dock.core.feed(topic, payload)
    assert names(told) == ["bad_message"]
    assert told.events[0].detail.startswith(f"{topic}: ")
    assert told.events[0].stamp_ns == stamp(1.0)
    assert names(*dock.sail(1.1, 1.2)) == []


def test_a_number_that_is_not_finite_is_no_odometry_and_no_goal() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    lost = Goal(stamp_ns=0, position_N=np.array([np.nan, 0.0]))
    assert names(dock.odometry(1.1, north=np.inf)) == ["bad_message"]
    assert names(dock.core.feed("goal", cdr.encode_goal(lost))) == ["bad_message"]


def test_a_cloud_of_nothing_but_nan_and_infinities_shows_no_object() -> None:
    dock = Dock()
    dock.odometry(0.0)
    points = np.array([[np.nan, 1, 2], [np.inf, -np.inf, 0], [1, np.nan, np.nan]] * 50)
    told = dock.core.feed("points", cdr.encode_point_cloud(cloud(0.0, points)))
    assert told.decision is not None
    assert len(told.decision.objects.p_L) == 0
    assert names(told) == []


def test_a_cloud_of_a_million_points_is_worked_on() -> None:
    dock = Dock()
    dock.odometry(0.0)
    points = np.random.default_rng(0).uniform(-30, 30, (1_000_000, 3))
    told = dock.core.feed("points", cdr.encode_point_cloud(cloud(0.0, points)))
    assert told.decision is not None
    assert dock.core.pipeline.perception.report.points == 1_000_000


def test_a_fault_of_the_policys_code_is_an_event_and_a_second_later_it_is_asked_again() -> None:
    dock = Dock()
    dock.sail(0.0, 1.0)
    dock.policy.failure = ZeroDivisionError("of ours")
    (failed,) = dock.sail(1.5, 1.5)
    assert names(failed) == ["internal_error"]
    assert failed.events[0].detail == "points: ZeroDivisionError: of ours"
    assert dock.policy.resets == 1
    dock.policy.failure = None
    assert thrusts(dock.sail(1.6, 2.5)) == [[0.0, 0.0]] * 10
    assert thrusts(dock.sail(2.6, 2.6)) == [[50.0, 50.0]]


def test_a_topic_that_is_not_the_cores_is_an_event_too() -> None:
    assert names(Dock().core.feed("clock", b"")) == ["internal_error"]

import numpy as np
import pytest
from tests.reference.assurance import gaps

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry, Tracks
from twinscrew.runtime.safety.prediction import (
    NO_CONTACT,
    AssuranceVessel,
    Circles,
    Foresight,
    surroundings,
)

DT = 0.1


def straight(speed: float, steps: int = 40) -> np.ndarray:
    x = speed * DT * np.arange(steps + 1)
    return np.column_stack([x, np.zeros((steps + 1, 2))])


def circles(*rows: tuple[float, float, float, float, float], horizon_s: float = 4.0) -> Circles:
    """x, y, vx, vy, radius of each."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Circles(
        id=tuple(range(7, 7 + len(table))),
        p_L=table[:, :2].copy(),
        v_L=table[:, 2:4].copy(),
        radius=table[:, 4],
        horizon_s=np.full(len(table), horizon_s),
    )


def contact(path, around, hull=((0.0, 2.8),), margin_m=0.5, approach_per_s=1.0):
    foresight = Foresight(
        AssuranceVessel(hull=hull),
        steps=1,
        dt=DT,
        slew_nps=1000.0,
        margin_m=margin_m,
        approach_per_s=approach_per_s,
    )
    return foresight.contact(path, around)


def test_gaps_are_those_worked_out_by_hand():
    hull = ((1.0, 0.5), (-1.0, 0.4))
    path = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, np.pi / 2]])
    around = circles((5.0, 0.0, 0.0, 0.0, 1.0), (1.0, 8.0, 0.0, -10.0, 0.2))
    expected = [
        [[4 - 1.5, 8 - 0.7], [6 - 1.4, np.hypot(2, 8) - 0.6]],
        [[5 - 1.5, 4 - 0.7], [np.hypot(4, 1) - 1.4, 6 - 0.6]],  # a quarter turned, 0.1 s later
    ]
    assert gaps(path, around, hull, DT) == pytest.approx(np.array(expected))


def test_a_buoy_dead_ahead_is_met_when_and_as_fast_as_it_comes():
    found = contact(straight(2.0), circles((8.8, 0.0, 0.0, 0.0, 1.0)))  # 5 m of open water
    assert found.time_s == pytest.approx(2.3)  # 4.6 m on: the first step inside the margin
    assert found.speed_mps == pytest.approx(2.0)
    assert found.track == 7
    assert found.excess > 0.5


def test_a_contact_that_comes_later_or_softer_does_less_harm():
    buoy = circles((8.8, 0.0, 0.0, 0.0, 1.0))
    farther = circles((9.8, 0.0, 0.0, 0.0, 1.0))
    assert contact(straight(2.0), buoy).excess > contact(straight(2.0), farther).excess > 0.0
    assert contact(straight(3.0), buoy).excess > contact(straight(2.0), buoy).excess


def test_a_contact_beyond_the_tracks_horizon_is_none():
    soon = circles((8.8, 0.0, -1.0, 0.0, 1.0), horizon_s=1.5)
    assert contact(straight(2.0), soon) is NO_CONTACT
    assert contact(straight(3.0), soon).excess > 0.0


def test_passing_outside_the_margin_is_no_contact():
    assert contact(straight(3.0), circles((6.0, 4.31, 0.0, 0.0, 1.0))) is NO_CONTACT


def test_lying_within_the_margin_or_leaving_it_is_no_contact():
    close = circles((3.9, 0.0, 0.0, 0.0, 1.0))  # a gap of 0.1 m
    assert contact(straight(0.0), close) is NO_CONTACT
    assert contact(straight(-1.0), close) is NO_CONTACT
    touching = circles((3.7, 0.0, 0.0, 0.0, 1.0))
    assert contact(straight(-1.0), touching) is NO_CONTACT
    assert contact(straight(0.05), touching).excess > 0.0


def test_who_overlaps_has_to_leave_but_need_not_flee():
    overlapping = circles((3.7, 0.0, 0.0, 0.0, 1.0))  # by 0.1 m
    deep = circles((1.8, 0.0, 0.0, 0.0, 1.0))  # by 2 m
    assert contact(straight(0.0, steps=1), overlapping).excess > 0.0
    assert contact(straight(-0.15, steps=1), overlapping) is NO_CONTACT
    assert contact(straight(-0.15, steps=1), deep).excess > 0.0
    assert contact(straight(-0.25, steps=1), deep) is NO_CONTACT


def test_within_the_margin_one_may_close_in_no_faster_than_the_gap_allows():
    close = circles((4.2, 0.0, 0.0, 0.0, 1.0))  # 0.4 m
    assert contact(straight(0.3, steps=1), close) is NO_CONTACT
    assert contact(straight(0.5, steps=1), close).excess > 0.0


def test_what_comes_at_us_is_met_even_when_we_lie_still():
    found = contact(straight(0.0), circles((0.0, -8.8, 0.0, 2.0, 1.0)))
    assert found.speed_mps == pytest.approx(2.0)
    assert not found.to_starboard


@pytest.mark.parametrize(("y", "side"), [(0.6, True), (-0.6, False)])
def test_a_contact_is_on_the_side_where_it_happens(y, side):
    assert contact(straight(2.0), circles((8.8, y, 0.0, 0.0, 1.0))).to_starboard is side


def test_of_several_the_first_one_met_is_named():
    around = circles((9.0, 0.0, 0.0, 0.0, 1.0), (6.0, 1.0, 0.0, 0.0, 1.0), (2.0, 9.0, 0, 0, 1.0))
    assert contact(straight(2.0), around).track == 8


def test_the_result_does_not_depend_on_the_order_of_the_tracks():
    rows = [(9.0, 0.5, 0.0, 0.0, 1.0), (7.0, 3.0, -1.0, -0.5, 1.0), (3.0, -7.0, 0.5, 2.0, 2.0)]
    excesses = {contact(straight(2.0), circles(*order)).excess for order in (rows, rows[::-1])}
    assert len(excesses) == 1


def odometry(heading: float) -> Odometry:
    return Odometry(
        stamp_ns=0,
        position_N=np.array([10.0, 20.0, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def tracks(p_N, v_N, radius) -> Tracks:
    count = len(radius)
    return Tracks(
        stamp_ns=0,
        id=np.arange(count) + 3,
        p_N=np.array(p_N, dtype=np.float64),
        v_N=np.array(v_N, dtype=np.float64),
        radius=np.array(radius, dtype=np.float64),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )


def around(heading: float, seen: Tracks) -> Circles:
    return surroundings(
        odometry(heading),
        seen,
        reach_m=15.0,
        horizon_s=(4.0, 1.5),
        least_radius_m=0.8,
        clearance_m=0.0,
        static_mps=0.4,
    )


def test_tracks_are_turned_into_the_vessels_frame():
    seen = tracks([[10.0, 25.0]], [[1.0, 0.0]], [1.5])
    there = around(np.pi / 2, seen)  # heading east: the track is dead ahead, going to port
    assert there.p_L == pytest.approx(np.array([[5.0, 0.0]]))
    assert there.v_L == pytest.approx(np.array([[0.0, -1.0]]))
    assert there.radius.tolist() == [1.5]


def test_what_cannot_be_met_within_the_horizon_is_left_out():
    p_N = [[10.0, 37.0], [10.0, 37.0], [10.0, 35.0]]
    v_N = [[0.0, 0.0], [0.0, -1.0], [0.0, 0.0]]  # 1 m too far, of which one comes 1.5 m nearer
    assert around(0.0, tracks(p_N, v_N, [1.0] * 3)).id == (4, 5)


def test_slow_tracks_stand_still_and_small_ones_are_not_taken_for_points():
    there = around(0.0, tracks([[15.0, 20.0]], [[0.3, 0.2]], [0.45]))
    assert there.v_L.tolist() == [[0.0, 0.0]]
    assert there.radius.tolist() == [0.8]

"""What the policy sees, against positions worked out by hand."""

import math

import numpy as np
import pytest

from twinscrew.runtime.charts.static_map import Area, StaticMap
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Goal, Odometry, Tracks
from twinscrew.runtime.policy.observation import (
    DEFAULTS,
    PAPER,
    ObservationSettings,
    Shown,
    nothing_seen,
    observe,
)

EAST = math.pi / 2


def odometry(
    position=(10.0, 20.0, 0.0), roll=0.0, pitch=0.0, yaw=0.0, v=(0.0, 0.0, 0.0), w=(0, 0, 0)
):
    return Odometry(
        stamp_ns=0,
        position_N=np.array(position),
        q_NB=quaternion_from_euler(roll, pitch, yaw),
        velocity_B=np.array(v, dtype=float),
        rates_B=np.array(w, dtype=float),
    )


def tracks(p_N, v_N=None, radius=None):
    p_N = np.asarray(p_N, dtype=float).reshape(-1, 2)
    count = len(p_N)
    return Tracks(
        stamp_ns=0,
        id=np.arange(count),
        p_N=p_N,
        v_N=np.zeros((count, 2)) if v_N is None else np.asarray(v_N, dtype=float),
        radius=np.ones(count) if radius is None else np.asarray(radius, dtype=float),
        covariance=np.zeros((count, 4, 4)),
        age_s=np.zeros(count),
    )


def goal(north=10.0, east=50.0):
    return Goal(stamp_ns=0, position_N=np.array([north, east]))


def see(p_N=(), *, o=None, g=None, settings=None, thrust=(0.0, 0.0), **kwargs):
    args = (o or odometry(), g or goal(), tracks(p_N, **kwargs), np.array(thrust))
    return observe(*args, settings) if settings else observe(*args)


def test_a_goal_in_the_east_is_to_starboard_when_heading_north():
    assert see().ego[:2] == pytest.approx([0.0, 30.0], abs=1e-5)


def test_a_goal_in_the_east_is_ahead_when_heading_east():
    assert see(o=odometry(yaw=EAST)).ego[:2] == pytest.approx([30.0, 0.0], abs=1e-5)


def test_a_goal_beyond_its_range_is_shown_at_that_range_in_its_direction():
    seen = see(g=goal(north=310.0, east=-380.0), settings=ObservationSettings(goal_range_m=50.0))
    assert seen.ego[:2] == pytest.approx([30.0, -40.0], abs=1e-5)


def test_a_goal_within_its_range_is_shown_where_it_is():
    exact = np.array([35.9 - 2.1, 41.0 - 2.0], np.float32)  # 51.6 m away
    seen = see(o=odometry((2.1, 2.0, 0.0)), g=goal(35.9, 41.0))
    assert np.array_equal(seen.ego[:2], exact)


def test_an_object_in_the_north_is_to_port_when_heading_east():
    seen = see([[15.0, 20.0]], v_N=[[2.0, 0.0]], o=odometry(yaw=EAST))
    assert seen.objects[0] == pytest.approx([0.0, -5.0, 0.0, -2.0, 1.0], abs=1e-5)


def test_velocities_of_objects_are_over_ground_not_relative():
    seen = see([[15.0, 20.0]], v_N=[[1.0, 0.0]], o=odometry(v=(3.0, 0.0, 0.0)))
    assert seen.objects[0, 2:4] == pytest.approx([1.0, 0.0])


def test_the_thrust_command_is_passed_on():
    assert see(thrust=(-500.0, 1000.0)).ego[5:] == pytest.approx([-500.0, 1000.0])


def test_pitch_does_not_move_an_object_nor_the_goal():
    flat, pitched = see([[15.0, 20.0]]), see([[15.0, 20.0]], o=odometry(pitch=0.2, roll=-0.1))
    assert np.array_equal(flat.objects, pitched.objects)
    assert np.array_equal(flat.ego[:2], pitched.ego[:2])


def test_surge_is_the_horizontal_speed_of_a_pitched_vessel():
    pitch = 0.3
    seen = see(o=odometry(pitch=pitch, v=(2.0, 0.0, 0.0)))
    assert seen.ego[2:4] == pytest.approx([2.0 * math.cos(pitch), 0.0], abs=1e-6)


def test_yaw_rate_of_a_rolled_vessel_is_about_the_vertical():
    roll = 0.4
    seen = see(o=odometry(roll=roll, w=(0.0, math.sin(roll), math.cos(roll))))
    assert seen.ego[4] == pytest.approx(1.0, abs=1e-6)


def test_objects_are_sorted_by_the_distance_of_their_surface_not_of_their_centre():
    seen = see([[18.0, 20.0], [19.0, 20.0]], radius=[0.5, 4.0])
    assert seen.objects[:2, 0] == pytest.approx([9.0, 8.0])


def test_only_the_nearest_five_are_seen():
    seen = see([[12.0 + k, 20.0] for k in range(7)])
    assert seen.mask.tolist() == [1.0] * 5
    assert seen.objects[:, 0] == pytest.approx([2.0, 3.0, 4.0, 5.0, 6.0])


def test_an_object_is_seen_up_to_the_range_of_its_edge():
    inside, outside = see([[30.9, 20.0]]), see([[31.1, 20.0]])
    assert (inside.mask.sum(), outside.mask.sum()) == (1.0, 0.0)


def test_the_range_is_a_setting():
    narrow = ObservationSettings(perception_range_m=3.0)
    assert see([[15.0, 20.0]], settings=narrow).mask.sum() == 0.0


def test_padding_is_zero_with_mask_zero():
    seen = see([[15.0, 20.0]])
    assert seen.mask.tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]
    assert not seen.objects[1:].any()


def test_equally_near_objects_keep_the_order_of_the_tracks():
    seen = see([[15.0, 20.0], [10.0, 25.0], [5.0, 20.0]])
    assert seen.objects[:3, :2] == pytest.approx(np.array([[5, 0], [0, 5], [-5, 0]]))


def test_everything_is_float32():
    seen = see([[15.0, 20.0]])
    assert {seen.ego.dtype, seen.objects.dtype, seen.mask.dtype} == {np.dtype(np.float32)}


QUAY = Area(kind="land", outline=np.array([[15.0, 0.0], [25.0, 0.0], [25.0, 60.0], [15.0, 60.0]]))
EDGES = Shown(contour_m=40.0)


def beside_a_quay(p_N=(), *, shown=EDGES, o=None, fixed=None, **kwargs):
    chart = StaticMap.of([QUAY]) if fixed is None else fixed
    place = o or odometry()
    return observe(place, goal(), tracks(p_N, **kwargs), np.zeros(2), DEFAULTS, shown, chart)


def test_a_quay_ahead_is_seen_by_the_contour_where_it_is():
    contour = beside_a_quay().contour
    assert contour[0] == pytest.approx(5.0)
    assert contour[16] == 40.0
    assert beside_a_quay(o=odometry(yaw=EAST)).contour[24] == pytest.approx(5.0)


def test_in_a_place_that_is_forbidden_the_contour_is_zero():
    assert (beside_a_quay(o=odometry((20.0, 20.0, 0.0))).contour == 0.0).all()


def test_without_a_chart_everything_is_at_range():
    assert (beside_a_quay(fixed=StaticMap.empty()).contour == 40.0).all()
    assert (
        observe(odometry(), goal(), tracks(()), np.zeros(2), DEFAULTS, EDGES).contour == 40
    ).all()
    assert (nothing_seen(EDGES).contour == 40.0).all()


def test_what_stands_on_the_chart_is_seen_once_and_what_moves_there_stays_an_object():
    on_the_quay, before_it = (15.5, 20.0), (11.0, 14.0)
    assert beside_a_quay([on_the_quay, before_it]).mask.sum() == 1
    moving = beside_a_quay([on_the_quay, before_it], v_N=[(0.0, 1.0), (0.0, 0.0)])
    assert moving.mask.sum() == 2
    assert beside_a_quay([on_the_quay, before_it], shown=PAPER).mask.sum() == 2


def test_a_policy_that_takes_no_contour_sees_what_it_saw_without_a_chart():
    with_chart = beside_a_quay([(15.5, 20.0), (11.0, 14.0)], shown=PAPER)
    without = see([(15.5, 20.0), (11.0, 14.0)])
    assert with_chart.contour is None
    assert np.array_equal(with_chart.objects, without.objects)
    assert np.array_equal(with_chart.ego, without.ego)


def test_a_learnt_wall_is_an_edge_of_the_contour_beside_the_maps():
    wall = np.array([[[-50.0, 28.0], [60.0, 28.0]]])  # 8 m to starboard
    shown = (odometry(), goal(), tracks(()), np.zeros(2), DEFAULTS, EDGES)
    alone = observe(*shown, None, wall).contour
    assert alone[8] == pytest.approx(8.0)
    assert alone[24] == 40.0
    both = observe(*shown, StaticMap.of([QUAY]), wall).contour
    assert both[8] <= 8.0 + 1e-6
    assert (both <= observe(*shown, StaticMap.of([QUAY])).contour).all()

"""Velocities from strips that two scans show."""

import numpy as np
import pytest

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.tracking.lidar import LidarExtras
from twinscrew.runtime.tracking.lidar_motion import HullVelocity, HullVelocitySettings

SECOND = 1_000_000_000
CENTRE = np.array([105.0, -3.0])
HULL = np.array(
    [[104.0, -2.0, 3.9, 90], [105.0, -4.0, 2.7, 70], [104.5, -3.2, 0.8, 20], [106.0, -2.9, 0.4, 10]]
)
"""North, east [m], length [m], echoes."""
STILL = np.zeros(2)


def measure(before, after, *, dt=0.1, expected=STILL, centre=CENTRE, **changes):
    finder = HullVelocity(HullVelocitySettings(**changes))
    now = LidarExtras(SECOND + round(dt * SECOND), np.ascontiguousarray(after))
    then = LidarExtras(SECOND, np.ascontiguousarray(before))
    return finder.measure(then, now, tuple(expected), tuple(centre))


def moved(rows, north, east, turn=0.0, centre=CENTRE):
    out = rows.copy()
    out[:, :2] = (rows[:, :2] - centre) @ rotation_2d(turn).T + centre + [north, east]
    return out


def test_what_has_moved_has_its_displacement_over_time():
    velocity = measure(HULL, moved(HULL, 0.2, -0.1))
    assert velocity.v_N == pytest.approx([2.0, -1.0], abs=1e-6)


def test_what_has_turned_has_the_velocity_of_its_centre():
    turned = moved(HULL, 0.1, 0.05, turn=0.03)
    velocity = measure(HULL, turned, centre=CENTRE + np.array([0.1, 0.05]), turn_radps=3.0)
    assert velocity.v_N == pytest.approx([1.0, 0.5], abs=0.02)


def test_strips_that_only_one_scan_shows_do_not_matter():
    new = np.array([[105.5, -3.5, 1.7, 40], [104.2, -2.2, 0.1, 3]])
    gone = np.array([[103.5, -2.5, 1.2, 30]])
    velocity = measure(np.concatenate([HULL, gone]), moved(np.concatenate([HULL, new]), 0.1, 0.1))
    assert velocity.v_N == pytest.approx([1.0, 1.0], abs=1e-6)


def test_strips_that_have_changed_their_length_do_not_matter():
    after = moved(HULL, 0.1, 0.1)
    after[0, [0, 2]] += [0.15, -0.3]
    assert measure(HULL, after).v_N == pytest.approx([1.0, 1.0], abs=1e-6)


def test_one_strip_that_goes_astray_is_outvoted():
    rows = np.concatenate([HULL, HULL + np.array([0.0, 0.0, 1.0, 0.0])])
    after = moved(rows, 0.1, 0.0)
    after[1, 1] += 0.12
    assert measure(rows, after).v_N == pytest.approx([1.0, 0.0], abs=0.05)


def test_a_fast_vessel_is_found_where_it_is_expected():
    after = moved(HULL, 0.6, 0.0)
    assert measure(HULL, after) is None
    velocity = measure(HULL, after, expected=np.array([5.0, 0.0]))
    assert velocity.v_N == pytest.approx([6.0, 0.0], abs=1e-6)


def test_one_strip_alone_says_nothing():
    assert measure(HULL[:1], HULL[:1]) is None
    assert measure(HULL[:1], HULL[:1], least_pairs=1) is not None


def test_nothing_seen_says_nothing():
    nothing = np.empty((0, 4))
    assert measure(nothing, HULL) is None
    assert measure(HULL, nothing) is None


@pytest.mark.parametrize("dt", [0.0, -0.1, 0.6])
def test_strips_of_long_ago_or_of_the_same_time_say_nothing(dt):
    assert measure(HULL, HULL, dt=dt) is None


def test_what_is_not_a_number_is_not_found():
    assert measure(np.full((4, 4), np.nan), HULL) is None
    broken = np.concatenate([HULL, np.full((1, 4), np.nan)])
    assert measure(HULL, broken).v_N == pytest.approx([0.0, 0.0], abs=1e-9)


def test_more_strips_and_finer_ones_are_surer():
    few, many = measure(HULL[:2], HULL[:2]), measure(HULL, HULL)
    coarse = HULL * [1, 1, 1, 0.2]
    assert many.R[0, 0] < few.R[0, 0]
    assert measure(coarse, coarse).R[0, 0] > 2 * many.R[0, 0]


def test_the_noise_is_what_it_is_said_to_be():
    rng, settings = np.random.default_rng(3), HullVelocitySettings(floor_m=1e-6)
    spacing = HULL[:, 2] / (HULL[:, 3] - 1)
    sigma = np.hypot(settings.sigma_m, settings.spacing_sigma * spacing)[:, None]
    squares = []
    for _ in range(400):
        after = HULL.copy()
        after[:, :2] += sigma * rng.standard_normal((4, 2))
        velocity = measure(HULL, after, floor_m=1e-6, robust_sigma=1e3)
        squares.append(velocity.v_N @ np.linalg.solve(velocity.R, velocity.v_N))
    assert np.mean(squares) == pytest.approx(2.0, abs=0.35)


def test_numbers_too_large_to_reckon_with_say_nothing():
    far = HULL * np.array([1e200, 1e200, 1.0, 1.0])
    assert measure(far, far) is None

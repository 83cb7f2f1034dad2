"""The tracker: what is born, followed, coasted, dropped; and what time may do."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import Strips
from twinscrew.runtime.tracking.lidar import MeasurementSettings
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

POINTS = TrackerSettings(
    measurement=MeasurementSettings(range_m=(10.0,), depth_m=(0.0,), small_depth_m=0.0)
)
"""Objects without a visible side: centroids are centres."""


def test_a_vessel_that_goes_straight_has_its_velocity_within_one_second():
    answers = scene.follow(Tracker(POINTS), lambda t: [[15 - 2 * t, 3 + t]], 13, sigma=0.03)
    assert answers[-1].v_N[0] == pytest.approx([-2.0, 1.0], abs=0.25)


def test_a_track_is_not_reported_before_it_was_seen_three_times():
    answers = scene.follow(Tracker(POINTS), lambda t: [[10.0, 0.0]], 4)
    assert [len(answer.id) for answer in answers] == [0, 0, 1, 1]


def test_a_ghost_of_two_scans_is_never_reported():
    answers = scene.follow(
        Tracker(POINTS), lambda t: [[10.0, 0.0]], 20, hidden=lambda t: [0] if t > 0.15 else []
    )
    assert all(len(answer.id) == 0 for answer in answers)


def test_the_motion_of_the_own_vessel_is_not_that_of_a_buoy():
    def ego(stamp_ns):
        t = stamp_ns / scene.SECOND
        return scene.odometry(stamp_ns, north=3.0 * t, east=math.sin(t), yaw=0.6 * t)

    answers = scene.follow(Tracker(POINTS), lambda t: [[12.0, 4.0]], 40, ego=ego)
    assert answers[-1].p_N[0] == pytest.approx([12.0, 4.0], abs=0.02)
    assert answers[-1].v_N[0] == pytest.approx([0.0, 0.0], abs=0.02)


def test_the_expected_depth_moves_the_track_away_from_the_sensor():
    settings = TrackerSettings(measurement=MeasurementSettings(range_m=(10.0,), depth_m=(0.5,)))
    answers = scene.follow(Tracker(settings), lambda t: [[10.0, 0.0]], 10, radius=2.0)
    assert answers[-1].p_N[0] == pytest.approx([10.5, 0.0], abs=1e-6)


def test_two_vessels_that_cross_keep_their_identities():
    def path(t):
        return [[10 + 2 * (t - 2), 1.5], [10 - 2 * (t - 2), -1.5]]

    answers = scene.follow(Tracker(POINTS), path, 40, sigma=0.05, seed=3)
    first, last = answers[5], answers[-1]
    assert last.id.tolist() == first.id.tolist()
    north = dict(zip(last.id, last.v_N[:, 0], strict=True))
    assert north[first.id[first.v_N[:, 0].argmax()]] == pytest.approx(2.0, abs=0.4)


def test_a_vessel_hidden_for_one_second_keeps_its_identity():
    hidden = lambda t: [0] if 2.0 <= t < 3.0 else []  # noqa: E731
    path = lambda t: [[15 - 2 * t, t]]  # noqa: E731
    answers = scene.follow(Tracker(POINTS), path, 45, sigma=0.05, hidden=hidden)
    assert {i for answer in answers for i in answer.id.tolist()} == {0}
    assert len(answers[25].id) == 1


def test_a_hidden_vessel_goes_on_where_it_went_and_says_for_how_long():
    hidden = lambda t: [0] if t >= 2.0 else []  # noqa: E731
    answers = scene.follow(Tracker(POINTS), lambda t: [[15 - 2 * t, t]], 30, hidden=hidden)
    assert answers[29].age_s[0] == pytest.approx(1.0)
    assert answers[29].p_N[0] == pytest.approx([15 - 5.8, 2.9], abs=0.3)


def test_a_vessel_that_does_not_come_back_is_forgotten():
    hidden = lambda t: [0] if t >= 3.0 else []  # noqa: E731
    answers = scene.follow(Tracker(POINTS), lambda t: [[10.0, t]], 60, hidden=hidden)
    assert len(answers[48].id) == 1
    assert len(answers[55].id) == 0


def test_what_was_hardly_known_is_forgotten_sooner():
    hidden = lambda t: [0] if t >= 0.35 else []  # noqa: E731
    answers = scene.follow(Tracker(POINTS), lambda t: [[10.0, t]], 20, hidden=hidden)
    assert len(answers[4].id) == 1
    assert len(answers[8].id) == 0


def test_uncertainty_grows_while_a_vessel_is_hidden():
    hidden = lambda t: [0] if t >= 2.0 else []  # noqa: E731
    answers = scene.follow(Tracker(POINTS), lambda t: [[10.0, t]], 30, hidden=hidden)
    size = [np.linalg.det(answer.covariance[0]) for answer in answers[19:30]]
    assert (np.diff(size) > 0).all()


def test_identities_are_never_used_again():
    tracker = Tracker(POINTS)
    first = scene.follow(tracker, lambda t: [[10.0, 0.0]], 5)[-1].id
    tracker.reset()
    second = scene.follow(tracker, lambda t: [[10.0, 0.0]], 5)[-1].id
    assert set(first.tolist()).isdisjoint(second.tolist())


def test_a_repeated_stamp_changes_nothing():
    tracker = Tracker(POINTS)
    before = scene.follow(tracker, lambda t: [[10.0, t]], 8)[-1]
    here = scene.odometry(7 * scene.SCAN)
    again = tracker.step(scene.objects([[5.0, 5.0]], here), here)
    assert again is before


def test_time_that_goes_backwards_starts_afresh_and_is_noted():
    tracker = Tracker(POINTS)
    scene.follow(tracker, lambda t: [[10.0, 0.0]], 10)
    assert tracker.note == ""
    here = scene.odometry(3 * scene.SCAN)
    answer = tracker.step(scene.objects([[10.0, 0.0]], here), here)
    assert len(answer.id) == 0
    assert "-0.600 s" in tracker.note


def test_after_a_jump_the_tracker_goes_on_and_drops_its_note():
    tracker = Tracker(POINTS)
    scene.follow(tracker, lambda t: [[10.0, 0.0]], 10)
    answers = scene.follow(tracker, lambda t: [[10.0, 0.0]], 5)
    assert tracker.note == ""
    assert len(answers[-1].id) == 1


def test_a_long_silence_starts_afresh():
    tracker = Tracker(POINTS)
    scene.follow(tracker, lambda t: [[10.0, 0.0]], 10)
    here = scene.odometry(60 * scene.SECOND)
    assert len(tracker.step(scene.objects([[10.0, 0.0]], here), here).id) == 0
    assert "forgotten" in tracker.note


def test_an_empty_sea_is_normal():
    answers = scene.follow(Tracker(POINTS), lambda t: np.empty((0, 2)), 5)
    last = answers[-1]
    assert (last.p_N.shape, last.v_N.shape, last.covariance.shape) == ((0, 2), (0, 2), (0, 4, 4))
    assert last.stamp_ns == 4 * scene.SCAN


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_an_object_that_is_not_finite_is_left_out(bad):
    tracker = Tracker(POINTS)
    for k in range(6):
        here = scene.odometry(k * scene.SCAN)
        seen = scene.objects([[3.0, 1.0], [10.0, 0.0]], here)
        seen.p_L[0, 0] = bad
        answer = tracker.step(seen, here)
    assert answer.id.tolist() == [0]
    assert np.isfinite(answer.p_N).all()


def test_odometry_that_is_not_finite_leaves_the_tracks_to_coast():
    tracker = Tracker(POINTS)
    scene.follow(tracker, lambda t: [[10.0, 0.0]], 10)
    good = scene.odometry(10 * scene.SCAN)
    bad = scene.odometry(10 * scene.SCAN, north=math.nan)
    answer = tracker.step(scene.objects([[10.0, 0.0]], good), bad)
    assert np.isfinite(answer.p_N).all()
    assert answer.age_s[0] == pytest.approx(0.1)


def test_scans_at_uneven_times_are_followed():
    tracker, rng = Tracker(POINTS), np.random.default_rng(0)
    stamp = 0
    for _ in range(30):
        stamp += int(rng.uniform(0.02, 0.3) * scene.SECOND)
        here = scene.odometry(stamp)
        answer = tracker.step(scene.objects([[2.0 * stamp / scene.SECOND, 5.0]], here), here)
    assert answer.v_N[0] == pytest.approx([2.0, 0.0], abs=0.05)


def test_the_same_scans_give_the_same_tracks_bit_for_bit():
    def run():
        path = lambda t: [[10 + 2 * t, 3.0], [12 - t, -4.0], [5.0, 5.0]]  # noqa: E731
        return scene.follow(Tracker(), path, 30, sigma=0.1, seed=7)

    for one, two in zip(run(), run(), strict=True):
        for field in ("id", "p_N", "v_N", "radius", "covariance", "age_s"):
            assert getattr(one, field).tobytes() == getattr(two, field).tobytes()


def test_a_reported_message_is_not_changed_by_later_scans():
    tracker = Tracker(POINTS)
    answer = scene.follow(tracker, lambda t: [[10.0, t]], 6)[-1]
    kept = answer.p_N.copy(), answer.covariance.copy()
    for k in range(6, 12):
        here = scene.odometry(k * scene.SCAN)
        tracker.step(scene.objects([[10.0, 0.1 * k]], here), here)
    assert np.array_equal(answer.p_N, kept[0])
    assert np.array_equal(answer.covariance, kept[1])


HULL = np.array([[-1.0, 0.9, 3.8, 80], [0.2, -0.9, 2.6, 60], [0.1, 0.0, 0.8, 20]])
"""Strips of a vessel from its centre: forward, starboard [m]; length [m]; echoes."""


def seen_with_strips(k, jumps, speed=2.0):
    """A vessel that goes north past the own one; its centroid jumps, its strips do not."""
    here, north = scene.odometry(k * scene.SCAN, yaw=0.7), speed * 0.1 * k - 3.0
    rows_N = HULL + np.array([north, 10.0, 0.0, 0.0])
    rows_L = rows_N.copy()
    rows_L[:, :2] = rows_N[:, :2] @ rotation_2d(0.7)
    seen = scene.objects([[north + jumps[k], 10.0]], here, radius=2.5)
    return replace(seen, strips=Strips(begin=np.array([0, 3]), rows_L=rows_L)), here


def test_a_centroid_that_jumps_does_not_spoil_a_velocity_that_strips_tell():
    jumps = np.random.default_rng(4).choice([-0.2, 0.2], 40)
    tracker, blind = Tracker(POINTS), Tracker(POINTS)
    error, without = [], []
    for k in range(40):
        seen, here = seen_with_strips(k, jumps)
        answer, same = tracker.step(seen, here), blind.step(replace(seen, strips=None), here)
        if k >= 13:
            error.append(answer.v_N[0] - [2.0, 0.0])
            without.append(same.v_N[0] - [2.0, 0.0])
    assert np.sqrt(np.mean(np.square(error))) < 0.05
    assert np.sqrt(np.mean(np.square(error))) < 0.3 * np.sqrt(np.mean(np.square(without)))


def test_strips_that_lie_do_not_keep_a_track_from_its_object():
    """Strips that stand still while the object goes 8 m: it is never farther off than its size."""
    tracker = Tracker(POINTS)
    for k in range(40):
        seen, here = seen_with_strips(k, np.zeros(40))
        still = seen_with_strips(0, np.zeros(40))[0].strips
        answer = tracker.step(replace(seen, strips=still), here)
    assert len(answer.id) == 1
    assert np.hypot(*(answer.p_N[0] - [2.0 * 3.9 - 3.0, 10.0])) < 2.5

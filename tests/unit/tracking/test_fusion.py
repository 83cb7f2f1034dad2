"""One tracker for several sensors."""

import numpy as np
import pytest

from twinscrew.runtime.settings import convert
from twinscrew.runtime.tracking.detections import bearings, positions
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

SECOND = 1_000_000_000
OWN = np.zeros(2)


PLAIN = {
    "acceleration_psd": 0.3,
    "under_way_mps": 0.5,
    "first_speed_mps": 2.5,
    "gate_sigma": 4.0,
    "buffer_s": 4.0,
}


def settings(**more):
    radar = {"detection": [0.9, 0.9], "range_m": [0.0, 300.0], "clutter": 1e-6}
    camera = {
        "measures": "bearing",
        "detection": [0.8, 0.8],
        "range_m": [0.0, 300.0],
        "clutter": 0.1,
    }
    lidar = {"detection": [0.95, 0.95, 0.0], "range_m": [0.0, 80.0, 90.0], "max_range_m": 90.0}
    tables = {"sources": {"radar": radar, "camera": camera, "lidar": lidar}, **PLAIN} | more
    return convert(tables, TrackerSettings)


def radar(places, t, **more):
    return positions(
        np.array(places, float).reshape(-1, 2),
        OWN,
        sigma_m=1.0,
        sigma_rad=0.005,
        stamp_ns=round(t * SECOND),
        source=more.get("source", "radar"),
    )


def camera(angles, t):
    return bearings(
        np.array(angles, float),
        OWN,
        sigma_m=0.5,
        sigma_rad=0.01,
        stamp_ns=round(t * SECOND),
        source="camera",
    )


def sail(t):
    return np.array([100.0 - 2.0 * t, 40.0])


def reported(fusion, t):
    return fusion.tracks_at(round(t * SECOND), OWN)


def test_a_steady_target_is_reported_and_followed():
    fusion, rng = Tracker(settings()), np.random.default_rng(0)
    for t in range(15):
        fusion.take(radar([sail(t) + rng.normal(0, 0.7, 2)], t))
    (track,) = reported(fusion, 14)
    assert np.hypot(*(track.x[:2] - sail(14))) < 2.0
    np.testing.assert_allclose(track.x[2:4], [-2.0, 0.0], atol=0.7)
    assert track.existence > 0.99


def test_scattered_clutter_is_no_track():
    source = {"clutter": 4 / 400**2, "range_m": [0.0, 300.0], "detection": [0.9, 0.9]}
    fusion = Tracker(convert({"sources": {"radar": source}, **PLAIN}, TrackerSettings))
    rng = np.random.default_rng(0)
    for t in range(60):
        fusion.take(radar(rng.uniform(-200, 200, (4, 2)), t))
        assert len(reported(fusion, t)) == 0


def test_a_target_that_vanishes_within_sight_is_dropped_and_its_identity_not_used_again():
    fusion = Tracker(settings())
    for t in range(10):
        fusion.take(radar([sail(t)], t))
    (first,) = reported(fusion, 9)
    for t in range(10, 40):
        fusion.take(radar([], t))
    assert not reported(fusion, 39)
    for t in range(40, 60):
        fusion.take(radar([sail(t - 40)], t))
    (second,) = reported(fusion, 59)
    assert second.id > first.id


def test_a_look_of_a_source_that_cannot_see_a_target_says_nothing_about_it():
    """A LiDAR that reaches 90 m does not see a target at 108 m: that is no evidence."""
    fusion = Tracker(settings())
    for t in range(10):
        fusion.take(radar([[108.0, 0.0]], t))
    (before,) = reported(fusion, 9)
    for k in range(50):
        fusion.take(radar([], 9 + 0.01 * k, source="lidar"))
    (after,) = reported(fusion, 9.5)
    assert after.existence == pytest.approx(before.existence, abs=0.02)
    for k in range(10):
        fusion.take(radar([], 9.5 + 0.01 * k))
    gone = [track.existence for track in reported(fusion, 9.6)]
    assert max(gone, default=0.0) < 0.9


def test_a_sector_that_looks_elsewhere_says_nothing():
    one_side = settings().sources["radar"]
    both = {"sources": {"radar": {"sector_rad": [-1.0, 1.0], "clutter": one_side.clutter}}}
    fusion = Tracker(convert(both, TrackerSettings))
    for t in range(10):
        fusion.take(radar([[80.0, 0.0]], t))
    (before,) = reported(fusion, 9)
    empty = radar([], 9.1)
    for k in range(30):
        turned = type(empty)(
            stamp_ns=empty.stamp_ns + k * 10_000_000,
            source="radar",
            origin_N=OWN,
            heading=np.pi,
            z=empty.z,
            H=empty.H,
            R=empty.R,
            R_rad2=empty.R_rad2,
        )
        fusion.take(turned)
    (after,) = reported(fusion, 9.4)
    assert after.existence == pytest.approx(before.existence, abs=0.02)


def test_bearings_start_nothing():
    fusion = Tracker(settings())
    for t in range(30):
        fusion.take(camera([0.3], t))
    assert not reported(fusion, 29)


def test_bearings_sharpen_a_track_across_the_line_of_sight():
    plain, aided = Tracker(settings()), Tracker(settings())
    for t in range(12):
        for fusion in (plain, aided):
            fusion.take(radar([sail(t)], t))
        aided.take(camera([np.arctan2(*sail(t + 0.5)[::-1])], t + 0.5))
    (without,), (with_camera,) = reported(plain, 12), reported(aided, 12)
    n = np.array([-np.sin(np.arctan2(40.0, 76.0)), np.cos(np.arctan2(40.0, 76.0))])
    assert n @ with_camera.P[:2, :2] @ n < 0.7 * (n @ without.P[:2, :2] @ n)


def test_looks_in_any_order_give_what_looks_in_order_give():
    rng = np.random.default_rng(3)
    looks = [radar([sail(0.5 * k) + rng.normal(0, 0.7, 2)], 0.5 * k) for k in range(40)]
    looks += [camera([np.arctan2(*sail(0.3 + k)[::-1])], 0.3 + k) for k in range(18)]
    in_order = sorted(looks, key=lambda look: look.stamp_ns)
    late = sorted(looks, key=lambda look: look.stamp_ns + rng.uniform(0, 2.0) * SECOND)
    answers = []
    for order in (in_order, late):
        fusion = Tracker(settings())
        assert all(fusion.take(look) for look in order)
        (track,) = reported(fusion, 20)
        answers.append(np.concatenate([track.x, track.P.ravel(), [track.existence]]))
    np.testing.assert_allclose(*answers, rtol=1e-9)


def test_a_look_that_comes_too_late_is_left_out_and_harms_nothing():
    fusion = Tracker(settings())
    for t in range(10):
        fusion.take(radar([sail(t)], t))
    (before,) = reported(fusion, 9)
    assert not fusion.take(radar([[0.0, 0.0]], 2))
    (after,) = reported(fusion, 9)
    np.testing.assert_array_equal(before.x, after.x)


def test_a_delay_of_the_source_is_made_up_for():
    """A radar that stamps its turns 2 s late shows where a target was, not where it is."""
    delayed = {"delay_s": 2.0, "detection": [0.9, 0.9], "range_m": [0.0, 300.0]}
    fusion = Tracker(convert({"sources": {"radar": delayed}, **PLAIN}, TrackerSettings))
    for t in range(20):
        fusion.take(radar([sail(t - 2.0)], t))
    (track,) = reported(fusion, 19)
    assert np.hypot(*(track.x[:2] - sail(19))) < 1.0


def test_two_targets_that_pass_keep_their_identities():
    rng = np.random.default_rng(5)
    fusion, names = Tracker(settings()), []
    for k in range(80):
        t = 0.5 * k
        places = np.array([[80.0, -40.0 + 2.0 * t], [92.0, 40.0 - 2.0 * t]])
        fusion.take(radar(places + rng.normal(0, 0.7, (2, 2)), t))
        found = {track.id: track.x[:2] for track in reported(fusion, t)}
        if len(found) == 2:
            names.append([min(found, key=lambda i: np.hypot(*(found[i] - p))) for p in places])
    assert len(names) > 60
    assert all(name == names[0] for name in names)


def test_a_target_in_the_shadow_of_another_is_not_given_up():
    fusion = Tracker(settings())
    far = lambda t: np.array([120.0, -30.0 + 2.0 * t])  # noqa: E731
    near = np.array([60.0, 5.0])
    for k in range(60):
        t = 0.5 * k
        places = [near + np.array([0.0, 0.2 * t])]
        hidden = 16.0 < t < 22.0
        if not hidden:
            places.append(far(t))
        fusion.take(radar(places, t))
        if k == 28:
            before = {track.id for track in reported(fusion, t)}
    assert {track.id for track in reported(fusion, 29.5)} == before
    assert len(before) == 2


def test_land_is_reported_only_if_it_moves():
    land = {"sees_land": True, "detection": [0.9, 0.9], "range_m": [0.0, 300.0]}
    fusion, rng = (
        Tracker(convert({"sources": {"radar": land}, **PLAIN}, TrackerSettings)),
        np.random.default_rng(2),
    )
    for t in range(60):
        places = np.array([[90.0, -20.0], sail(t) if t < 45 else [10.0, 40.0]])
        fusion.take(radar(places + rng.normal(0, 0.5, (2, 2)), t))
    (track,) = reported(fusion, 59)  # the one that has docked; not the pier
    assert np.hypot(*(track.x[:2] - [10.0, 40.0])) < 3.0


@pytest.mark.parametrize(("crowd", "shown"), [(1, True), (40, False)])
def test_a_bearing_tells_a_boat_from_land_unless_bearings_are_everywhere(crowd, shown):
    land = {"sees_land": True, "detection": [0.9, 0.9], "range_m": [0.0, 300.0], "clutter": 1e-6}
    camera_table = {
        "measures": "bearing",
        "detection": [0.8, 0.8],
        "range_m": [0.0, 300.0],
        "clutter": 0.3,
        "clutter_memory_s": 20.0,
    }
    sources = {"sources": {"radar": land, "camera": camera_table}}
    fusion, rng = Tracker(convert(sources | PLAIN, TrackerSettings)), np.random.default_rng(5)
    moored = np.array([90.0, -20.0])
    towards = np.arctan2(moored[1], moored[0])
    for t in range(40):
        angles = [towards + rng.normal(0, 0.005), *rng.uniform(-np.pi, np.pi, crowd - 1)]
        fusion.take(camera(angles, t - 0.5))
        fusion.take(radar([moored + rng.normal(0, 0.5, 2)], t))
    assert bool(reported(fusion, 39)) == shown


def test_a_new_track_is_reported_no_longer_once_it_is_missed():
    """What a radar sees some times and then no more was a wave; an old track is given time."""
    for hits, shown in ((8, False), (25, True)):
        existence = {"report_new": 0.9, "report": 0.2}
        fusion, rng = Tracker(settings(existence=existence)), np.random.default_rng(6)
        for t in range(hits):
            fusion.take(radar([sail(t) + rng.normal(0, 0.7, 2)], t))
        assert reported(fusion, hits - 1)
        for t in range(hits, hits + 3):
            fusion.take(radar([], t))
        assert bool(reported(fusion, hits + 2)) == shown


def test_a_vessel_and_what_it_tows_are_one():
    tables = {"vessel": {"length_m": 24.0}}
    fusion, rng = Tracker(settings(**tables)), np.random.default_rng(4)
    for t in range(40):
        tow = sail(t) + np.array([15.0, 0.0])
        fusion.take(radar(np.array([sail(t), tow]) + rng.normal(0, 0.4, (2, 2)), t))
    (track,) = reported(fusion, 39)
    assert np.hypot(*(track.x[:2] - sail(39))) < 3.0


@pytest.mark.slow
def test_the_state_errors_are_as_large_as_stated():
    """Position and velocity NEES of simulated targets: the mean of independent runs is near 4."""
    rng, nees, dt = np.random.default_rng(7), [], 0.5
    for _ in range(40):
        fusion, truth = Tracker(settings(rest_psd=0.3)), np.array([90.0, 40.0, -2.0, 0.5])
        Q = 0.3 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        for k in range(40):
            kick = np.linalg.cholesky(Q) @ rng.standard_normal((2, 2))
            truth = truth + np.array([*(dt * truth[2:]), 0.0, 0.0]) + kick.ravel()
            u = truth[:2] / np.hypot(*truth[:2])
            across = np.hypot(1.0, 0.005 * np.hypot(*truth[:2]))
            z = truth[:2] + rng.normal() * u + rng.normal(0, across) * np.array([-u[1], u[0]])
            fusion.take(radar([z], dt * k))
        for track in reported(fusion, dt * k):
            e = track.x[:4] - truth
            nees.append(e @ np.linalg.solve(track.P[:4, :4], e))
    assert len(nees) >= 38
    # chi-squared with 4 degrees of freedom: the mean of 40 has a standard deviation of 0.45
    assert 3.1 < np.mean(nees) < 4.9

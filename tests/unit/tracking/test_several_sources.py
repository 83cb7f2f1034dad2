"""The boat's own tracker with a radar beside its LiDAR: one file, its settings, one line."""

import importlib.util
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.tracking.detections import Look, SourceSettings, positions
from twinscrew.runtime.tracking.lidar import MeasurementSettings
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

POINTS = MeasurementSettings(range_m=(10.0,), depth_m=(0.0,), small_depth_m=0.0)
RADAR = SourceSettings(range_m=(0.0, 200.0), detection=(0.9, 0.9), clutter=1e-6, delay_s=0.2)
REACH_M = 20.0
"""[m] How far the LiDAR sees."""


@dataclass(frozen=True)
class RadarPlots:
    """A radar's message: plots as range [m] and bearing [rad] off the bow, some time ago."""

    stamp_ns: int
    ranges_m: np.ndarray
    bearings_rad: np.ndarray


def radar_look(plots, odometry) -> Look:
    """The whole of a new sensor: its message to a look of the tracker."""
    bearing = plots.bearings_rad + odometry.heading
    offset = plots.ranges_m[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    own_N = odometry.position_N[:2]
    look = positions(
        own_N + offset,
        own_N,
        sigma_m=0.7,
        sigma_rad=0.01,
        stamp_ns=plots.stamp_ns,
        source="radar",
    )
    return replace(look, heading=odometry.heading)


def plots(p_N, here, rng, stamp_ns):
    offset = p_N - here.position_N[:2]
    ranges = np.hypot(*offset.T) + rng.normal(0, 0.7, len(offset))
    bearings = np.arctan2(offset[:, 1], offset[:, 0]) - here.heading
    return RadarPlots(stamp_ns, ranges, bearings + rng.normal(0, 0.01, len(offset)))


def ship(t):
    """It comes from 80 m at 3 m/s, passes, and goes on."""
    return np.array([[80.0 - 3.0 * t, 6.0]])


def passage(tracker, seconds, *, radar=True, lidar=True, order=None):
    """Feed a LiDAR at 10 Hz and a radar at 1 Hz, whose plots are 0.2 s old; give the answers."""
    rng, answers = np.random.default_rng(0), []
    for k in range(10 * seconds):
        t, here = 0.1 * k, scene.odometry(k * scene.SCAN, yaw=0.4)
        if radar and k % 10 == 3:
            tracker.take(radar_look(plots(ship(t - 0.2), here, rng, here.stamp_ns), here))
        near = np.hypot(*ship(t).T) < REACH_M
        seen = ship(t)[near & lidar] + rng.normal(0, 0.02, (int((near & lidar).sum()), 2))
        answers.append(tracker.step(scene.objects(seen, here), here))
    return answers


def with_radar(**more):
    return Tracker(TrackerSettings(measurement=POINTS, sources={"radar": RADAR}, **more))


def test_the_radar_shows_a_ship_long_before_the_lidar_does_and_it_keeps_its_identity():
    aided = passage(with_radar(), 40)
    alone = passage(Tracker(TrackerSettings(measurement=POINTS)), 40, radar=False)
    first = next(k for k, answer in enumerate(aided) if len(answer.id))
    assert first < next(k for k, answer in enumerate(alone) if len(answer.id)) - 100
    names = {name for answer in aided for name in answer.id.tolist()}
    assert len(names) == 1
    assert all(len(answer.id) == 1 for answer in aided[first:])


def test_where_both_see_a_ship_it_is_as_exact_as_the_lidar():
    answers = passage(with_radar(), 30)
    at = 240  # 24 s: 8 m ahead
    assert answers[at].p_N[0] == pytest.approx(ship(24.0)[0], abs=0.1)
    assert answers[at].v_N[0] == pytest.approx([-3.0, 0.0], abs=0.2)


def test_what_the_radar_sees_is_where_it_is_now_though_plots_are_old():
    answers = passage(with_radar(), 18, lidar=False)
    assert answers[-1].p_N[0] == pytest.approx(ship(17.9)[0], abs=1.5)


def test_an_empty_lidar_scan_says_nothing_of_what_lies_beyond_its_range():
    answers = passage(with_radar(), 15)
    assert len(answers[-1].id) == 1
    assert answers[-1].p_N[0, 0] > REACH_M


def test_a_ghost_of_the_radar_within_the_lidars_sight_is_given_up_sooner():
    """Of six plots, 10 m ahead, the LiDAR sees nothing: after them the track is soon gone."""
    lasted = {}
    for lidar in (True, False):
        tracker, rng = with_radar(), np.random.default_rng(1)
        ghost, lasted[lidar] = np.array([[10.0, 3.0]]), 0
        for k in range(300):
            here = scene.odometry(k * scene.SCAN)
            if k % 10 == 0:
                places = ghost if k < 60 else np.empty((0, 2))
                tracker.take(radar_look(plots(places, here, rng, here.stamp_ns), here))
            if lidar:
                tracker.step(scene.objects(np.empty((0, 2)), here), here)
            reported = tracker.tracks_at(here.stamp_ns, here.position_N[:2])
            lasted[lidar] += len(reported)
        assert not reported
    assert lasted[True] < 0.8 * lasted[False]


def test_scans_and_looks_in_any_order_within_the_buffer_give_the_same_tracks():
    rng = np.random.default_rng(2)
    events = []
    for k in range(260):
        t, here = 0.1 * k, scene.odometry(k * scene.SCAN)
        near = np.hypot(*ship(t).T) < REACH_M
        events.append((k * scene.SCAN, ("scan", scene.objects(ship(t)[near], here), here)))
        if k % 10 == 3:
            look = radar_look(plots(ship(t - 0.2), here, rng, here.stamp_ns), here)
            events.append((here.stamp_ns - 200_000_000, ("look", look, here)))
    shuffled = sorted(events, key=lambda e: e[0] + rng.uniform(0.0, 0.35) * scene.SECOND)
    finals = []
    for order in (sorted(events, key=lambda e: (e[0], e[1][0] == "scan")), shuffled):
        tracker = with_radar()
        for _, (kind, what, here) in order:
            if kind == "scan":
                tracker.step(what, here)
            else:
                assert tracker.take(what)
            assert tracker.note == ""
        here = scene.odometry(260 * scene.SCAN)
        finals.append(tracker.step(scene.objects(ship(26.0), here), here))
    assert len(finals[0].id) == len(finals[1].id) == 1
    np.testing.assert_allclose(finals[0].p_N, finals[1].p_N, atol=1e-6)
    np.testing.assert_allclose(finals[0].covariance, finals[1].covariance, rtol=1e-3)


def test_a_late_scan_erases_nothing():
    tracker = Tracker(TrackerSettings(measurement=POINTS))
    scene.follow(tracker, lambda t: [[10.0, t]], 20)
    late = scene.odometry(17 * scene.SCAN - scene.SCAN // 2)
    answer = tracker.step(scene.objects([[10.0, 1.65]], late), late)
    assert tracker.note == ""
    assert len(answer.id) == 1
    assert answer.stamp_ns == 19 * scene.SCAN
    assert answer.p_N[0] == pytest.approx([10.0, 1.9], abs=0.05)

"""Ships that say who they are: one ship is one track, whichever sensors see it."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.tracking.detections import SourceSettings, positions
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.named import Report, outline_distance
from twinscrew.runtime.tracking.track import Named
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

AIS = SourceSettings(identifies=True, acceleration_psd=0.02, radius_m=5.0)
RADAR = SourceSettings(range_m=(0.0, 400.0), detection=(0.9, 0.9), clutter=1e-6)
SECOND = 10 * scene.SCAN


def named(stamp_ns, identity="257123450", half_length=10.0, heading=math.pi / 2, half_beam=3.0):
    radius = math.hypot(half_length, half_beam)
    until_ns = stamp_ns + 50 * SECOND
    return Named(identity, f"{identity} NORDLYS", half_length, half_beam, radius, heading, until_ns)


def report(p_N, v_N, stamp_ns, **more):
    look = positions(
        np.array([p_N], float),
        np.zeros(2),
        sigma_m=5.0,
        sigma_rad=0.0,
        stamp_ns=stamp_ns,
        source="ais",
    )
    return replace(look, extras=[Report(named(stamp_ns, **more), np.array(v_N, float))])


def passage(
    tracker, seconds, *, lidar=True, radar=False, ais_s=10, offset=(0.0, 0.0), begin=-120.0, **ship
):
    """A ship passes at 4 m/s, 10 m north of the boat; give the tracks of every scan."""
    rng, answers = np.random.default_rng(1), []
    for k in range(10 * seconds):
        here, p_N = scene.odometry(k * scene.SCAN), np.array([[10.0, begin + 0.4 * k]])
        if ais_s and k % (10 * ais_s) == 0:
            told = p_N[0] + offset + rng.normal(0.0, 3.0, 2)
            tracker.take(report(told, (0.0, 4.0), here.stamp_ns, **ship))
        if radar and k % 25 == 0:
            seen = p_N + rng.normal(0.0, 1.5, (1, 2))
            look = positions(
                seen,
                np.zeros(2),
                sigma_m=2.0,
                sigma_rad=0.01,
                stamp_ns=here.stamp_ns,
                source="radar",
            )
            tracker.take(look)
        near = p_N[np.hypot(*p_N.T) < 20.0] if lidar else p_N[:0]
        answers.append(tracker.step(scene.objects(near, here), here))
    return answers


BOAT = {"half_length": 1.2, "half_beam": 0.6}
"""A vessel as small as the LiDAR's objects are."""


def make(**sources):
    """Its LiDAR looks 20 m far."""
    return Tracker(TrackerSettings(sources=sources), SensorView(reach_m=20.0))


@pytest.mark.parametrize("radar", [False, True])
def test_one_ship_is_one_track_from_first_report_to_last(radar):
    sources = {"ais": AIS, "radar": RADAR} if radar else {"ais": AIS}
    answers = passage(make(**sources), 60, radar=radar, **BOAT)
    assert {tuple(tracks.id.tolist()) for tracks in answers[30:]} == {(0,)}
    assert all(tracks.name == ("257123450 NORDLYS",) for tracks in answers)
    for k, tracks in enumerate(answers[100:]):
        off = tracks.p_N[0] - (10.0, -120.0 + 0.4 * (k + 100))
        assert np.hypot(*off) < 12.0
        assert abs(tracks.v_N[0, 1] - 4.0) < 1.0


def test_a_track_of_the_radar_takes_the_name_when_the_ship_reports_itself():
    tracker = make(ais=AIS, radar=RADAR)
    before = passage(tracker, 30, radar=True, ais_s=0, lidar=False)
    assert before[-1].id.tolist() == [0]
    assert before[-1].name is None
    stamp_ns = 300 * scene.SCAN
    tracker.take(report((10.0, 0.0), (0.0, 4.0), stamp_ns))
    tracks = tracker.step(
        scene.objects(np.empty((0, 2)), scene.odometry(stamp_ns)), scene.odometry(stamp_ns)
    )
    assert tracks.id.tolist() == [0]
    assert tracks.name == ("257123450 NORDLYS",)


def test_the_outline_is_told_where_the_whole_ship_is_known():
    answers = passage(make(ais=AIS), 30)
    far = answers[100]
    assert (far.half_length, far.half_beam) == ([10.0], [3.0])
    assert far.heading[0] == pytest.approx(math.pi / 2)
    assert far.radius[0] == pytest.approx(math.hypot(10.0, 3.0))


def test_what_the_lidar_sees_of_a_long_ship_is_a_part_that_moves_as_the_ship_does():
    answers = passage(make(ais=AIS), 40)
    near = [tracks for tracks in answers if len(tracks.id) == 2]
    assert len(near) > 50
    for tracks in near:
        assert tracks.id[0] == 0
        assert tracks.name == ("257123450 NORDLYS", "")
        assert tracks.half_length[0] == 10.0
        assert math.isnan(tracks.half_length[1])
        assert abs(tracks.v_N[1, 1] - 4.0) < 0.5


def test_the_lidars_tracks_are_the_same_to_the_last_bit_whatever_ais_says_elsewhere():
    alone, aided = passage(make(), 60, ais_s=0), passage(make(ais=AIS), 60, offset=(300.0, 0.0))
    for one, two in zip(alone, aided, strict=True):
        mine = np.array([not name for name in two.name or ("",) * len(two.id)], bool)
        np.testing.assert_array_equal(one.p_N, two.p_N[mine])
        np.testing.assert_array_equal(one.v_N, two.v_N[mine])
        np.testing.assert_array_equal(one.covariance, two.covariance[mine])


def test_the_outline_of_a_ship_moves_to_what_the_lidar_sees_of_it():
    tracker = make(ais=AIS)
    for k in range(40):
        here, ship = scene.odometry(k * scene.SCAN), np.array([16.0, -8.0 + 0.4 * k])
        if k == 0:  # the report is 4 m too far north
            tracker.take(report(ship + np.array([4.0, 0.0]), (0.0, 4.0), here.stamp_ns))
        side = ship - (3.0, 0.0)
        tracks = tracker.step(scene.objects(side[None], here), here)
        if k == 1:
            before = tracks.p_N[0, 0]
    assert before > 19.0
    assert abs(tracks.p_N[0, 0] - 16.0) < 1.5
    assert tracks.name[0] == "257123450 NORDLYS"


def test_a_name_alone_changes_no_position():
    tracker, here = make(ais=AIS), scene.odometry(0)
    tracker.take(report((10.0, 100.0), (0.0, 4.0), 0))
    before = tracker.step(scene.objects(np.empty((0, 2)), here), here)
    look = report((10.0, 300.0), (0.0, 4.0), 0, half_length=30.0)
    tracker.take(replace(look, extras=[replace(look.extras[0], names_only=True)]))
    here = scene.odometry(1)
    after = tracker.step(scene.objects(np.empty((0, 2)), here), here)
    np.testing.assert_allclose(after.p_N, before.p_N, atol=1e-6)
    assert after.half_length[0] == 30.0


def test_a_buoy_beside_a_ship_is_not_taken_for_it():
    tracker = make(ais=AIS)
    for k in range(80):
        here = scene.odometry(k * scene.SCAN)
        ship = (12.0, -40.0 + 0.4 * k)
        if k % 40 == 0:
            tracker.take(report(ship, (0.0, 4.0), here.stamp_ns))
        tracks = tracker.step(scene.objects(np.array([[8.0, -12.0]]), here), here)
    k = tracks.name.index("")
    np.testing.assert_allclose(tracks.p_N[k], (8.0, -12.0), atol=0.7)
    assert np.hypot(*tracks.v_N[k]) < 0.3


def test_a_ship_that_the_lidar_should_see_and_does_not_is_doubted_and_not_shown():
    tracker = make(ais=AIS)
    for k in range(30):
        here = scene.odometry(k * scene.SCAN)
        if k % 10 == 0:
            look = report((5.0, 0.0), (0.0, 0.0), here.stamp_ns, half_length=1.5)
            tracker.take(replace(look, R=0.5 * np.eye(2)[None]))
        tracks = tracker.step(scene.objects(np.empty((0, 2)), here), here)
    assert tracks.id.tolist() == []
    assert tracker.doubted == ("257123450 NORDLYS",)


def test_a_silent_ship_is_kept_as_long_as_its_last_report_says_and_grows_vague():
    tracker = make(ais=AIS)
    tracker.take(report((10.0, 300.0), (0.0, -4.0), 0))
    sigma, last = [], 0
    for k in range(700):
        here = scene.odometry(k * scene.SCAN)
        tracks = tracker.step(scene.objects(np.empty((0, 2)), here), here)
        if len(tracks.id):
            last = k
            sigma.append(tracks.covariance[0, 1, 1])
    assert last == 500
    assert np.all(np.diff(sigma) > 0.0)
    assert 5.0 < math.sqrt(sigma[-1]) < 50.0


def test_the_distance_to_an_outline_is_zero_within_and_grows_outside():
    ship, centre = named(0), np.array([0.0, 0.0])  # its bow points east
    assert outline_distance(np.array([2.9, 9.9]), centre, ship) == 0.0
    assert outline_distance(np.array([0.0, 14.0]), centre, ship) == pytest.approx(4.0)
    assert outline_distance(np.array([6.0, 14.0]), centre, ship) == pytest.approx(5.0)
    round_one = replace(ship, heading=math.nan)
    assert outline_distance(np.array([0.0, 14.0]), centre, round_one) == pytest.approx(
        14 - 10.44, abs=0.01
    )

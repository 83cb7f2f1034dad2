"""Tracks of the pieces of long things: those of a quay stand, those of a ship go with her."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.reference.flat_world import Eye, look, scans, ship, wall
from tests.unit.perception import echoes

from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Objects, Outline
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.tracker import Tracker

_spec = importlib.util.spec_from_file_location("scene", Path(__file__).with_name("scene.py"))
scene = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(scene)

QUAY = wall((-100.0, 6.0), (100.0, 6.0))
"""Longer than can be seen."""
AHEAD = lambda t: (2.0 * t, 0.0, 0.0)  # noqa: E731
STILL = lambda t: (0.0, 0.0, 0.0)  # noqa: E731


def track(bodies, path, times_s, *, has_outline=True):
    """Give the tracks of each scan, and how many objects it shows."""
    tracker, answers = Tracker(), []
    for t in times_s:
        objects, _ = look(bodies, t, path(t), Eye())
        seen = objects if has_outline else replace(objects, outline=None)
        tracks = tracker.step(seen, scene.odometry(objects.stamp_ns, *path(t)))
        answers.append((tracks, len(objects.radius)))
    return answers


def speeds(tracks):
    return np.linalg.norm(tracks.v_N, axis=1)


@pytest.mark.parametrize("noise_m", [0.0, 0.03])
def test_pieces_that_slide_along_a_quay_have_no_speed(noise_m):
    rng, tracker = np.random.default_rng(1), Tracker()
    for t in scans(6.0):
        objects, _ = look([QUAY], t, AHEAD(t), Eye())
        objects.p_L[:] += noise_m * rng.standard_normal(objects.p_L.shape)
        tracks = tracker.step(objects, scene.odometry(objects.stamp_ns, *AHEAD(t)))
        assert t < 1.5 or (len(tracks.id) >= 8 and speeds(tracks).max() < 0.05)
    apart = np.linalg.norm(tracks.p_N[:, None] - tracks.p_N, axis=2)
    assert apart[apart > 0.0].min() > 2.0


@pytest.mark.parametrize("name", ["vrx16", "vrx32", "vlp16", "hdl32e", "os1_64"])
@pytest.mark.parametrize("away_m", [5.0, 12.0, 25.0, 40.0])
def test_a_quay_that_perception_sees_from_a_boat_in_waves_stands(name, away_m):
    """It is endless, so each scan shows it all along the boat, which goes at 2 m/s."""
    sensor = echoes.sensor(name)
    perception, rng = Perception(sensor), np.random.default_rng(0)
    tracker, reports, moves = Tracker(view=SensorView.of(sensor)), 0, 0
    for t in scans(4.0):
        q_NB = quaternion_from_euler(0.06 * math.sin(2.0 * t), 0.05 * math.cos(1.5 * t), 0.0)
        points_S = echoes.wall(sensor, away_m, q_NB, low=0.0, aft=-200.0, ahead=200.0)
        points_S *= 1.0 + rng.normal(0.0, 0.001, (len(points_S), 1))
        seen = perception.step(echoes.cloud(points_S), q_NB)
        here = scene.odometry(round(1e9 * t), *AHEAD(t))
        tracks = tracker.step(replace(seen, stamp_ns=here.stamp_ns), here)
        fast = speeds(tracks) > 0.05 if t >= 1.5 else np.zeros(len(tracks.id), bool)
        reports, moves = reports + len(fast), moves + int(fast.sum())
    assert moves <= 0.01 * reports
    assert (tracks.age_s == 0.0).sum() >= 5


def test_without_an_outline_the_pieces_go_along_with_the_boat():
    for tracks, _ in track([QUAY], AHEAD, scans(6.0), has_outline=False)[15:]:
        assert speeds(tracks).max() > 1.5


def test_the_tracks_of_a_quay_stay_where_its_pieces_are():
    """They slide with the pieces: none is left behind, none is added."""
    answers = track([QUAY], AHEAD, scans(6.0))
    for t, (tracks, objects) in zip(scans(6.0)[15:], answers[15:], strict=True):
        assert len(tracks.id) == objects
        assert abs(tracks.p_N[:, 0] - 2.0 * t).max() < 20.0
        assert tracks.p_N[:, 1] == pytest.approx(6.0, abs=1.1)


@pytest.mark.parametrize(("has_outline", "at_once"), [(True, True), (False, False)])
def test_a_new_piece_of_what_stands_is_reported_at_once(has_outline, at_once):
    """The nearer the boat comes to the quay, the more of it is within range."""
    far = wall((-100.0, 18.0), (100.0, 18.0))
    path = lambda t: (0.0, 1.5 * t, 0.0)  # noqa: E731
    answers = track([far], path, scans(6.0), has_outline=has_outline)[20:]
    assert answers[-1][1] >= answers[0][1] + 2
    shown = [(tracks.age_s == 0.0).sum() == objects for tracks, objects in answers]
    assert all(shown) is at_once


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_a_ship_that_starts_is_known_to_go_about_a_second_after_she_is_told_to_move(speed):
    answers = track([ship(0.0, 8.0, 0.0, speed, start_s=3.0)], STILL, scans(6.0))
    ahead = np.array([tracks.v_N[:, 0].mean() for tracks, _ in answers[15:]])
    assert speeds(answers[30][0]).max() < 0.05
    begins = 15 + int(np.flatnonzero(ahead > 0.05)[0])
    assert begins <= 30 + 15  # within a second and a half
    for tracks, _ in answers[begins + 10 :]:
        assert tracks.v_N[:, 0].mean() == pytest.approx(speed, abs=0.35)
        assert abs(tracks.v_N[:, 1]).max() < 0.35


def test_a_ship_that_moors_has_no_speed_once_she_is_told_to_stand():
    answers = track([ship(-6.0, 8.0, 0.0, 2.0, stop_s=3.0)], STILL, scans(6.0))
    assert answers[30][0].v_N[:, 0].min() > 1.0
    assert speeds(answers[-1][0]).max() < 0.05


def ring(k, cut_from):
    """Two things 1 m apart, in the walls of a round harbour of which they may be pieces."""
    azimuth = np.radians(np.arange(0.25, 360.0, 0.5))
    outline = Outline(
        boundary_L=10.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth)]),
        height_m=np.zeros(len(azimuth)),
        seen=np.zeros(len(azimuth), dtype=np.int64),
        cut_from=np.array([*cut_from, 0]),
        sector_rad=math.radians(0.5),
        is_closed=True,
        sensor_L=np.zeros(3),
        down_L=np.array([0.0, 0.0, 1.0]),
        elevation_rad=np.empty(0),
        least_m=-math.inf,
    )
    return Objects(
        stamp_ns=k * scene.SCAN,
        p_L=np.array([[10.0, -0.5], [10.0, 0.5], [-10.0, 0.0]]),
        radius=np.full(3, 2.0),
        points=np.full(3, 100),
        outline=outline,
    )


@pytest.mark.parametrize(("cut_from", "count"), [((0, 0), 3), ((-1, -1), 2)])
def test_pieces_of_what_stands_are_not_joined(cut_from, count):
    tracker = Tracker()
    for k in range(30):
        tracks = tracker.step(ring(k, cut_from), scene.odometry(k * scene.SCAN))
    assert len(tracks.id) == count
    assert (tracks.age_s == 0.0).all()


def test_pieces_are_told_apart_though_others_are_joined():
    """Two halves of one vessel come before the pieces: joining them shifts everybody's number."""
    tracker = Tracker()
    for k, t in enumerate(scans(4.0)):
        objects, _ = look([QUAY], t, AHEAD(t), Eye())
        apart_m = 1.0 if k > 10 else 20.0
        halves = np.array([[4.0, -5.0], [4.0, -5.0 - apart_m]])
        outline = replace(
            objects.outline, cut_from=np.concatenate([[-1, -1], objects.outline.cut_from])
        )
        seen = Objects(
            stamp_ns=k * scene.SCAN,
            p_L=np.concatenate([halves, objects.p_L]),
            radius=np.concatenate([[2.0, 2.0], objects.radius]),
            points=np.concatenate([[100, 100], objects.points]),
            outline=outline,
        )
        tracks = tracker.step(seen, scene.odometry(objects.stamp_ns, *AHEAD(t)))
    is_quay = tracks.p_N[:, 1] > 0.0
    assert speeds(tracks)[is_quay].max() < 0.05
    assert is_quay.sum() == len(objects.radius)
    assert (~is_quay & (tracks.age_s == 0.0)).sum() == 1
    assert speeds(tracks)[~is_quay] == pytest.approx(2.0, abs=0.2)

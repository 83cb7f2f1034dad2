"""What the LiDAR has learnt: quays where they are, no ships, and a memory that does not grow."""

import math

import numpy as np
import pytest

from twinscrew.hil_sim.bench.harbour_scenes import OWN, Body, passage, sights
from twinscrew.runtime._native import FreeWater
from twinscrew.runtime.charts.learnt import LearntMap, LearntSettings
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Float64, Odometry, Outline
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.tracking.lidar import SensorView
from twinscrew.runtime.tracking.tracker import Tracker

SECTORS = 360


def odometry(time_s: float, north: float = 0.0) -> Odometry:
    return Odometry(
        stamp_ns=round(time_s * 1e9),
        position_N=np.array([north, 0.0, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, 0.0),
        velocity_B=np.zeros(3),
        rates_B=np.zeros(3),
    )


def outline(away_m: float | None, range_m: float = 20.0, bearing: float = 0.0) -> Outline:
    """A wall across the bow, or at another bearing; or open water."""
    angle = np.linspace(-np.pi, np.pi, SECTORS, endpoint=False) + np.pi / SECTORS
    reach = np.full(SECTORS, range_m)
    seen = np.full(SECTORS, -1)
    if away_m is not None:
        facing = np.maximum(np.cos(angle - bearing), 1e-9)
        wall = np.where(facing > 0.3, away_m / facing, np.inf)
        reach, seen = np.minimum(reach, wall), np.where(wall < range_m, 0, -1)
    return Outline(
        boundary_L=reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]),
        height_m=np.where(seen >= 0, 1.0, np.nan),
        seen=seen.astype(np.int64),
        cut_from=np.array([0] if away_m is not None else [-1]),
        sector_rad=2 * np.pi / SECTORS,
        is_closed=True,
        sensor_L=np.array([0.0, 0.0, -2.0]),
        down_L=np.array([0.0, 0.0, 1.0]),
        elevation_rad=np.radians(np.arange(-20.0, 5.0)),
        least_m=0.1,
    )


def water(seen: Outline) -> FreeWater:
    return FreeWater(
        boundary=seen.boundary_L,
        heights=seen.height_m,
        seen=seen.seen,
        begin=seen.sensor_L.tolist(),
        sector=seen.sector_rad,
        guard=0.0175,
        is_closed=seen.is_closed,
        elevations=seen.elevation_rad,
        down=seen.down_L.tolist(),
        least=seen.least_m,
    )


def look(learnt: LearntMap, time_s: float, seen: Outline, north: float = 0.0, stands=True) -> None:
    learnt.step(odometry(time_s, north), seen, lambda: water(seen), {0: stands})


def test_a_wall_is_one_after_three_scans_and_lies_where_its_echoes_do() -> None:
    learnt = LearntMap()
    for scan in range(2):
        look(learnt, scan / 10, outline(10.0))
    assert len(learnt.walls) == 0
    look(learnt, 0.2, outline(10.0))
    assert len(learnt.walls) > 20
    np.testing.assert_allclose(learnt.walls[:, :, 0], 10.0, atol=0.01)
    assert np.abs(learnt.walls[:, :, 1]).max() > 12.0


def test_what_moves_or_is_not_known_to_stand_is_no_wall() -> None:
    learnt = LearntMap()
    for scan in range(20):
        look(learnt, scan / 10, outline(10.0), stands=False)
    assert len(learnt.walls) == 0


def test_a_wall_that_beams_pass_is_water_again_and_one_that_nobody_sees_stays() -> None:
    learnt = LearntMap()
    for scan in range(30):
        look(learnt, scan / 10, outline(10.0))
    count = len(learnt.walls)
    look(learnt, 3.0, outline(6.0))  # something else hides it
    for scan in range(30):
        look(learnt, 4.0 + scan / 10, outline(6.0), stands=False)
    assert len(learnt.walls) >= count
    assert learnt.wall_age_s(np.array([10.01, 0.1])) == pytest.approx(4.0, abs=0.05)
    for scan in range(12):
        look(learnt, 8.0 + scan / 10, outline(None, 25.0))
    assert len(learnt.walls) == 0
    assert learnt.free_age_s(np.array([10.01, 0.1])) <= 0.5


def test_a_low_wall_is_not_gone_because_beams_pass_over_its_top() -> None:
    """From near by, a quay of 1 m lies under every beam that looks farther."""
    learnt = LearntMap()
    for scan in range(10):
        look(learnt, scan / 10, outline(10.0))
    over = outline(None)
    for scan in range(30):  # 2 m before it the lowest beam is 1.3 m high
        look(learnt, 1.0 + scan / 10, over, north=8.0)
    kept = learnt.edges_near(np.array([10.0, 0.0]), 1.0)
    assert len(kept) > 0


def test_what_has_not_been_seen_for_long_is_forgotten() -> None:
    learnt = LearntMap(LearntSettings(keep_s=60.0))
    for scan in range(10):
        look(learnt, scan / 10, outline(10.0))
    look(learnt, 100.0, outline(3.0), stands=False)
    assert len(learnt.walls) == 0


def test_memory_does_not_grow_on_the_way_along_a_wall_and_what_is_near_stays() -> None:
    learnt = LearntMap(LearntSettings(cells=64))  # 32 m
    most = 0
    for scan in range(400):
        beside = outline(10.0, bearing=math.pi / 2)
        look(learnt, scan / 10, beside, north=0.1 * scan)
        most = max(most, len(learnt.walls))
        off = learnt.walls.reshape(-1, 2) - [0.1 * scan, 0.0]
        assert not len(off) or np.abs(off).max() <= 16.0 + 4.5
    assert 10 < most < 64 * 64
    learnt.reset()
    assert len(learnt.walls) == 0


def test_the_same_array_is_given_until_something_changes() -> None:
    learnt = LearntMap()
    for scan in range(10):
        look(learnt, scan / 10, outline(10.0))
    first, version = learnt.walls, learnt.version
    look(learnt, 2.0, outline(10.0))
    assert learnt.version == version
    assert learnt.walls is first


@pytest.fixture(scope="module", params=[1, 4])
def sailed(request: pytest.FixtureRequest) -> tuple[LearntMap, list[Body]]:
    """A passage along a quay, past a ship, in waves, with everything real but the sea."""
    rng = np.random.default_rng(request.param)
    sensor, bodies = load_sensor("vrx32"), passage(rng)
    tracker, learnt = Tracker(view=SensorView.of(sensor)), LearntMap()
    for sight in sights(sensor, bodies, rng):
        tracker.step(sight.objects, sight.odometry)
        view = tracker.outline
        assert view is not None
        learnt.step(sight.odometry, view.outline, lambda view=view: view.water, tracker.stands)
    return learnt, bodies


def _off_m(places_N: Float64, quay: Body) -> Float64:
    """How far places are from the faces of a quay, a box."""
    cosine, sine = np.cos(quay.heading), np.sin(quay.heading)
    local = np.abs((places_N - quay.start_N) @ np.array([[cosine, -sine], [sine, cosine]]))
    beyond = local - quay.shape.halves[0, :2]
    outside = np.hypot(*np.maximum(beyond, 0.0).T)
    return np.where(outside > 0.0, outside, -beyond.max(axis=1))


@pytest.mark.slow
def test_quays_are_learnt_within_some_decimetres_and_ships_under_way_are_not(
    sailed: tuple[LearntMap, list[Body]],
) -> None:
    learnt, bodies = sailed
    quays = [body for body in bodies[OWN + 1 :] if not body.tilts]
    places = learnt.walls.mean(axis=1)
    assert len(places) > 20
    off = np.min([_off_m(places, quay) for quay in quays], axis=0)
    assert np.median(off) < 0.25
    assert np.mean(off > 1.0) < 0.05

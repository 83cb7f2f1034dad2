"""Properties of perception that hold for every scan."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs
from tests.harness.work import examples
from tests.reference import segmentation as reference

from twinscrew.hil_sim.bench.numpy_segmentation import labels as numpy_labels
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.segmentation import Perception, PerceptionSettings, make_kernel
from twinscrew.runtime.perception.sensor import Beams, Columns, Mount, Sensor

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
ALL_ROUND = Sensor(
    name="test",
    beams=Beams(count=12, lowest_rad=-0.2, highest_rad=0.35),
    columns=Columns(count=120, first_rad=math.pi, span_rad=-2 * math.pi, endpoint=False),
    rate_hz=10.0,
    scan_duration_s=0.0,
    range_min_m=0.5,
    range_max_m=50.0,
    noise_sigma_m=0.01,
    mount=Mount(x_m=0.0, y_m=0.0, z_m=2.0),
)
UNEVEN = Sensor(
    name="uneven",
    beams=Beams(elevations_deg=(-20.0, -12.0, -7.0, -4.0, -2.0, -0.5, 1.0, 3.0, 8.0)),
    columns=Columns(count=61, first_rad=-1.2, span_rad=2.4, endpoint=True),
    rate_hz=10.0,
    scan_duration_s=0.0,
    range_min_m=0.5,
    range_max_m=50.0,
    noise_sigma_m=0.02,
    mount=Mount(x_m=0.0, y_m=0.0, z_m=2.0),
)
EVERYTHING = PerceptionSettings(max_range_m=20.0, hull=None, water=None)


def make_cloud(points_S: np.ndarray) -> PointCloud:
    return PointCloud(stamp_ns=0, frame_id="s", points_S=np.asarray(points_S, np.float32))


def blocks(rng: np.random.Generator, sensor: Sensor, count: int) -> np.ndarray:
    """Give a range for every ray: rectangles of the image at random distances, with noise."""
    rows, columns = len(sensor.elevations), sensor.columns.count
    ranges = np.full((rows, columns), np.inf)
    for _ in range(count):
        r, c = rng.integers(rows), rng.integers(columns)
        h, w = rng.integers(1, rows + 1), rng.integers(1, columns // 3)
        across = np.arange(c, c + w) % columns
        slope = rng.uniform(-0.2, 0.2) * np.arange(w)
        ranges[r : r + h, across] = np.maximum(rng.uniform(1.0, 18.0) + slope, 0.6)
    ranges += rng.normal(0.0, sensor.noise_sigma_m, ranges.shape)
    ranges[rng.random(ranges.shape) < 0.15] = np.inf
    return ranges


def points_of(ranges: np.ndarray, sensor: Sensor) -> np.ndarray:
    seen = np.isfinite(ranges)
    return (sensor.directions_S()[seen] * ranges[seen][:, None]).astype(np.float32)


@given(
    near=st.floats(0.1, 100.0),
    more=st.floats(0.0, 50.0),
    alpha=st.floats(1e-3, 1.0),
    theta=st.floats(0.05, 3.0),
)
def test_the_criterion_without_trigonometry_is_the_papers(
    near: float, more: float, alpha: float, theta: float
) -> None:
    far = near + more
    beta = math.atan2(near * math.sin(alpha), far - near * math.cos(alpha))
    k = math.cos(alpha) + math.sin(alpha) / math.tan(theta)
    if abs(beta - theta) > 1e-9:  # at the threshold itself, rounding decides
        assert (beta > theta) == (far < k * near)


@settings(max_examples=examples(60), deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    sensor=st.sampled_from([ALL_ROUND, UNEVEN]),
    bridged=st.integers(0, 3),
    theta=st.floats(0.2, 2.0),
)
def test_the_kernel_finds_the_clusters_of_the_plain_reference(
    seed: int, sensor: Sensor, bridged: int, theta: float
) -> None:
    rng = np.random.default_rng(seed)
    points_S = points_of(blocks(rng, sensor, 8), sensor)
    open_water = PerceptionSettings(
        max_range_m=20.0, hull=None, water=None, bridged=bridged, theta_rad=theta
    )
    perception = Perception(sensor, open_water)
    perception.project(make_cloud(points_S), LEVEL)
    count = perception.segment()
    image = perception.range_image()
    expected = reference.range_image(points_S, sensor, 0.5, 20.0)
    np.testing.assert_allclose(image, expected, rtol=1e-6)
    noise = 3.0 * math.sqrt(2.0) * sensor.noise_sigma_m
    labels = reference.labels(image.astype(np.float64), sensor, theta, noise, bridged)
    assert reference.same_partition(perception.labels(), labels)
    assert reference.same_partition(
        numpy_labels(image, sensor, perception.settings).astype(np.int64), labels
    )
    assert count == len(np.unique(labels[labels >= 0]))


@pytest.mark.slow
@settings(max_examples=examples(40), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), sensor=st.sampled_from([ALL_ROUND, UNEVEN]))
def test_points_anywhere_go_to_the_cell_that_trigonometry_says(seed: int, sensor: Sensor) -> None:
    rng = np.random.default_rng(seed)
    points_S = rng.normal(0.0, 6.0, (300, 3)).astype(np.float32)
    perception = Perception(sensor, EVERYTHING)
    for point in points_S:
        report = perception.project(make_cloud(point[None]), LEVEL)
        rows, columns, distances = reference.cells(nearly(point), sensor)
        cell = np.argwhere(perception.point_image() == 0)
        if not 0.5 < distances[0] < 20.0:
            assert report.range == 1
        elif len(cell) == 0:
            assert report.no_beam == 1
            assert min(rows.min(), columns.min()) < 0
        else:
            assert cell[0][0] in rows
            assert cell[0][1] in columns


def nearly(point: np.ndarray) -> np.ndarray:
    """Give a point, and it turned by the error of the kernel's angles: on edges each is right."""
    error = 4e-6  # rad; fast_atan2 is within 3e-6
    x, y, z = point.astype(np.float64)
    beside = [(x - s * y, y + s * x, z) for s in (-error, error)]
    above = [(x, y, z + s * math.hypot(x, y)) for s in (-error, error)]
    return np.array([(x, y, z), *beside, *above])


@settings(max_examples=examples(30), deadline=None)
@given(seed=st.integers(0, 2**32 - 1), columns=st.integers(1, 119))
def test_turning_the_sensor_turns_the_objects(seed: int, columns: int) -> None:
    rng = np.random.default_rng(seed)
    ranges = np.full((12, 120), np.inf)
    for start in (5, 45, 85):  # three things far apart, each smaller than a circle
        width = int(rng.integers(3, 8))
        ranges[2:10, start : start + width] = rng.uniform(4.0, 15.0)
    perception = Perception(ALL_ROUND, EVERYTHING)
    before = perception.step(make_cloud(points_of(ranges, ALL_ROUND)), LEVEL)
    turned = np.roll(ranges, columns, axis=1)
    after = perception.step(make_cloud(points_of(turned, ALL_ROUND)), LEVEL)
    a = columns * ALL_ROUND.azimuth_step
    R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    assert len(before.radius) == 3
    expected, got = before.p_L @ R.T, after.p_L
    order = [int(np.argmin(np.hypot(*(got - p).T))) for p in expected]
    np.testing.assert_allclose(got[order], expected, atol=1e-3)
    np.testing.assert_allclose(after.radius[order], before.radius, atol=1e-3)
    assert after.points[order].tolist() == before.points.tolist()


@settings(max_examples=examples(30), deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_the_points_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points_S = points_of(blocks(rng, ALL_ROUND, 8), ALL_ROUND)
    perception = Perception(ALL_ROUND, EVERYTHING)
    before = perception.step(make_cloud(points_S), LEVEL)
    after = perception.step(make_cloud(rng.permutation(points_S)), LEVEL)
    assert before.p_L.tobytes() == after.p_L.tobytes()
    assert before.radius.tobytes() == after.radius.tobytes()
    assert before.points.tobytes() == after.points.tobytes()


@settings(max_examples=examples(30), deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_noise_far_away_adds_no_object(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points_S = points_of(blocks(rng, ALL_ROUND, 5), ALL_ROUND)
    far = rng.normal(size=(2000, 3))
    far *= rng.uniform(21.0, 45.0, (2000, 1)) / np.linalg.norm(far, axis=1, keepdims=True)
    perception = Perception(ALL_ROUND, EVERYTHING)
    before = perception.step(make_cloud(points_S), LEVEL)
    after = perception.step(make_cloud(np.concatenate([far, points_S])), LEVEL)
    assert before.p_L.tobytes() == after.p_L.tobytes()
    assert before.radius.tobytes() == after.radius.tobytes()


ODD = [0.0, -0.0, 1e-45, 1e-38, 1e-20, 1e20, 3e38, np.nan, np.inf, -np.inf, 1.0, -7.0]


@settings(max_examples=examples(60), deadline=None)
@given(
    values=st.lists(st.sampled_from(ODD), min_size=0, max_size=90),
    sensor=st.sampled_from([ALL_ROUND, UNEVEN]),
)
def test_odd_numbers_are_counted_and_give_finite_objects(
    values: list[float], sensor: Sensor
) -> None:
    count = len(values) // 3
    points_S = np.array(values[: 3 * count], np.float32).reshape(-1, 3)
    perception = Perception(sensor, PerceptionSettings(min_points=1))
    objects = perception.step(make_cloud(points_S), LEVEL)
    r = perception.report
    assert r.points == count
    assert r.points == r.empty + r.range + r.no_beam + r.hull + r.water + r.hidden + r.used
    assert np.isfinite(objects.p_L).all()
    assert np.isfinite(objects.radius).all()
    assert objects.points.sum() == r.used


@settings(max_examples=examples(40), deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    sensor=st.sampled_from([ALL_ROUND, UNEVEN]),
    takes_time=st.booleans(),
    has_times=st.booleans(),
)
def test_eight_lanes_give_the_same_bits_as_four(
    seed: int, sensor: Sensor, takes_time: bool, has_times: bool
) -> None:
    rng = np.random.default_rng(seed)
    points = points_of(blocks(rng, sensor, 8), sensor)[: rng.integers(0, 1500)]
    spoilt = np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 1e-30, 3e38, 5.0], np.float32)
    at = rng.random(points.shape) < 0.05
    points[at] = rng.choice(spoilt, int(at.sum()))
    count = len(points)
    intensity = rng.uniform(0.0, 20.0, count).astype(np.float32)
    time = rng.choice(np.array([0.0, 0.05, -0.02, np.nan, 1e9], np.float32), count)
    one = structs.replace(
        sensor, scan_duration_s=0.1 if takes_time else 0.0, weak_intensity=10.0, gives_misses=False
    )
    q_NB = quaternion_from_euler(*rng.uniform(-0.3, 0.3, 3))
    rates, velocity = rng.normal(0.0, 1.0, (2, 3))
    answers = []
    for wide in (False, True):
        kernel = make_kernel(one, PerceptionSettings(min_points=1), wide=wide)
        scan = (points, intensity, time if has_times else None, q_NB, rates, velocity)
        counts, found = kernel.scan(*scan)
        arrays = (*found, kernel.range_image(), kernel.point_image(), kernel.object_image())
        answers.append(
            [getattr(counts, name) for name in ("hull", "water", "no_beam", "hidden", "used")]
            + [array.tobytes() for array in arrays]
        )
    assert answers[0] == answers[1]

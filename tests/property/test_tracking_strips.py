"""The kernels of the strips do what their plain references do, in any scene."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples
from tests.reference import shift as shift_reference
from tests.reference import strips as strips_reference

from twinscrew.runtime.geometry import rotation_2d
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.segmentation import Perception, PerceptionSettings
from twinscrew.runtime.perception.sensor import Beams, Columns, Mount, Sensor
from twinscrew.runtime.tracking.lidar import LidarExtras
from twinscrew.runtime.tracking.lidar_motion import HullVelocity, HullVelocitySettings

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
OPEN = PerceptionSettings(hull=None, water=None, strip_gap_m=0.4)


def sensor(wraps: bool) -> Sensor:
    span = 2 * math.pi if wraps else 2.4
    return Sensor(
        name="test",
        beams=Beams(count=6, lowest_rad=-0.15, highest_rad=0.1),
        columns=Columns(count=240, first_rad=-span / 2, span_rad=span, endpoint=not wraps),
        rate_hz=10.0,
        scan_duration_s=0.0,
        range_min_m=0.5,
        range_max_m=50.0,
        noise_sigma_m=0.01,
        mount=Mount(x_m=0.4, y_m=0.0, z_m=2.0),
    )


def scene(rng: np.random.Generator, s: Sensor) -> np.ndarray:
    """Give echoes of flat things of any size, some before others, some partly beyond the range."""
    rows, columns = len(s.elevations), s.columns.count
    ranges = np.full((rows, columns), np.inf)
    for _ in range(rng.integers(1, 9)):
        first, count = rng.integers(columns), rng.integers(2, 40)
        across = np.arange(first, first + count) % columns
        low = rng.integers(rows)
        away = rng.uniform(2.0, 21.0) + rng.uniform(-0.1, 0.1) * np.arange(count)
        here = ranges[low:, across]
        ranges[low:, across] = np.minimum(here, np.maximum(away, 0.8))
    ranges[rng.random(ranges.shape) < 0.05] = np.inf
    seen = np.isfinite(ranges)
    return (s.directions_S()[seen] * ranges[seen][:, None]).astype(np.float32)


@given(seed=st.integers(0, 10**6), wraps=st.booleans())
@settings(max_examples=examples(60), deadline=None)
def test_the_strips_are_those_of_the_plain_reference(seed: int, wraps: bool) -> None:
    s = sensor(wraps)
    points_S = scene(np.random.default_rng(seed), s)
    perception = Perception(s, OPEN)
    cloud = PointCloud(stamp_ns=0, frame_id="s", points_S=points_S)
    found = perception.step(cloud, LEVEL).strips
    p_L = points_S[perception.point_image()] @ s.R_BS.T + s.mount_position_B
    expected = strips_reference.strips(
        perception.range_image().astype(float),
        perception.object_image(),
        p_L[..., :2].astype(float),
        s.wraps,
        OPEN.strip_gap_m,
        OPEN.max_range_m - OPEN.strip_gap_m,
    )
    owners = np.repeat(np.arange(len(found.begin) - 1), np.diff(found.begin))
    table = np.column_stack([owners, found.rows_L])
    assert table == pytest.approx(expected, abs=1e-4)


def hull(rng: np.random.Generator, count: int) -> np.ndarray:
    places = rng.uniform(-2.5, 2.5, (count, 2)) + np.array([1000.0, -500.0])
    return np.column_stack([places, rng.uniform(0.05, 4.0, count), rng.integers(2, 90, count)])


@given(seed=st.integers(0, 10**6), count=st.integers(0, 12), fresh=st.integers(0, 5))
@settings(max_examples=examples(60), deadline=None)
def test_the_shift_is_that_of_the_plain_reference(seed: int, count: int, fresh: int) -> None:
    rng, rules = np.random.default_rng(seed), HullVelocitySettings()
    before, centre = hull(rng, count), np.array([1000.0, -500.0])
    after = np.concatenate([before, hull(rng, fresh)])
    turned = (after[:, :2] - centre) @ rotation_2d(rng.normal(0.0, 0.03)).T + centre
    after[:, :2] = turned + rng.uniform(-0.2, 0.2, 2) + rng.normal(0.0, 0.01, (len(after), 2))
    guess = rng.uniform(-1.0, 1.0, 2)
    expected = shift_reference.shift(before, after, 0.1 * guess, centre, 0.06, rules)
    velocity = HullVelocity(rules).measure(
        LidarExtras(0, before), LidarExtras(100_000_000, after), guess, centre
    )
    if expected is None:
        assert velocity is None
        return
    displacement, covariance = expected
    assert 0.1 * velocity.v_N == pytest.approx(displacement, abs=1e-8)
    R = 0.01 * velocity.R
    assert pytest.approx(covariance + rules.floor_m**2 * np.eye(2), rel=1e-6, abs=1e-12) == R

"""Scans far larger than any sensor's, and many of them: all are perceived, none is kept."""

from __future__ import annotations

import gc
import resource
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.bench.scenes import basin
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import PointCloud
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor

pytestmark = pytest.mark.slow

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
MILLION = 1_000_000
PAGE_MB = resource.getpagesize() / 1e6


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB


def traced_bytes() -> int:
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


def test_a_million_points_go_from_the_wire_to_objects() -> None:
    rng = np.random.default_rng(0)
    points_S = rng.normal(0.0, 8.0, (MILLION, 3)).astype(np.float32)
    points_S[::100] = np.inf
    intensity = np.full(MILLION, 100.0, np.float32)
    sent = PointCloud(stamp_ns=7, frame_id="lidar", points_S=points_S, intensity=intensity)
    cloud = cdr.decode_point_cloud(cdr.encode_point_cloud(sent))
    np.testing.assert_array_equal(cloud.points_S, points_S)
    perception = Perception(load_sensor("vrx32"))
    objects = perception.step(cloud, LEVEL)
    report = perception.report
    assert (report.points, report.empty) == (MILLION, MILLION // 100)
    rows, columns = perception.sensor.image_shape
    assert rows * columns // 2 < report.used <= rows * columns
    assert 0 < objects.points.sum() <= report.used
    assert np.isfinite(objects.p_L).all()


def test_memory_is_steady_over_many_scans() -> None:
    perception = Perception(load_sensor("vrx32"))
    payloads = [
        cdr.encode_point_cloud(basin(perception.sensor, points, seed))
        for seed, points in enumerate((70_000, 1_500, 30_000, 0))
    ]

    def perceive(times: int) -> None:
        for _ in range(times):
            for payload in payloads:
                perception.step(cdr.decode_point_cloud(payload), LEVEL)

    perceive(10)
    before_mb = resident_mb()
    tracemalloc.start()
    try:
        perceive(2)
        kept = traced_bytes()
        perceive(60)
        grown = traced_bytes() - kept
    finally:
        tracemalloc.stop()
    assert grown < 20_000  # 240 scans; the points of one of 30 000 have 360 000
    assert resident_mb() - before_mb < 8.0

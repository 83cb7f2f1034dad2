"""Images derived from points: the beams of data sets' sensors are found in their scans."""

import numpy as np
import pytest
from tests.harness import street

from twinscrew.runtime.perception.fit import fitted
from twinscrew.runtime.perception.sensor import load_sensor

FRD = np.array([1, -1, -1], np.float32)


@pytest.mark.parametrize("rings", [True, False])
def test_the_beams_of_a_clean_scan_are_found(rings: bool) -> None:
    scan = street.like_nuscenes()
    first = fitted(scan.points * FRD, scan.ring if rings else None, load_sensor("vlp16"))[0]
    truth = load_sensor("hdl32e").elevations
    assert first.elevations == pytest.approx(truth, abs=np.radians(0.05))
    assert first.columns.count == pytest.approx(1084, rel=0.02)


def test_smeared_beams_become_even_rows_as_many_as_the_beams() -> None:
    scan = street.like_kitti()
    even = fitted(scan.points * FRD, None, load_sensor("os1_64"))[-1]
    assert len(even.elevations) == pytest.approx(64, abs=10)
    assert np.ptp(np.diff(even.elevations)) < 1e-9


def test_points_without_a_pattern_give_no_sensor() -> None:
    nothing = np.full((500, 3), np.nan, np.float32)
    nothing[:50] = 0.0
    assert fitted(nothing, None, load_sensor("vlp16")) == []
    straight_up = np.tile(np.float32([0, 0, -3]), (500, 1))
    assert fitted(straight_up, np.zeros(500, np.uint16), load_sensor("vlp16")) == []

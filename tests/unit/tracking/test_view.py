"""What of a sensor decides how much of a hull it shows."""

import math

import pytest

from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.tracking.lidar import SensorView


def test_the_default_is_the_sensor_whose_depths_were_measured():
    view = SensorView.of(load_sensor("vrx32"))
    assert (view.height_m, view.lowest_rad) == (1.93, 0.186)
    assert view.row_rad == pytest.approx(SensorView().row_rad, abs=1e-4)
    assert view.near_scale == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "row_deg"), [("vrx16", 2.0), ("vlp16", 2.0), ("hdl32e", 4 / 3), ("os1_64", 45 / 63)]
)
def test_the_gap_between_rows_is_the_descriptions(name: str, row_deg: float) -> None:
    assert SensorView.of(load_sensor(name)).row_rad == pytest.approx(
        math.radians(row_deg), rel=1e-3
    )


def test_a_beam_twice_as_steep_comes_down_twice_as_near():
    assert SensorView(lowest_rad=math.atan(2 * math.tan(0.186))).near_scale == pytest.approx(0.5)
    assert SensorView(height_m=2 * 1.93).near_scale == pytest.approx(2.0)


def test_a_sensor_that_only_looks_up_has_a_view():
    assert SensorView(lowest_rad=1e-3).near_scale > 100.0


def test_a_sensor_without_a_mount_is_taken_to_be_as_high_as_usual():
    assert SensorView.of(load_sensor("vlp16")).height_m == SensorView().height_m

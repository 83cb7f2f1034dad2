import math

import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.perception.sensor import Mount, Sensor, load_sensor
from twinscrew.runtime.settings import convert

SHIPPED = ["vrx16", "vrx32", "vlp16", "hdl32e", "os1_64"]


def description(**changes: object) -> dict[str, object]:
    return {
        "name": "test",
        "beams": {"count": 4, "lowest_rad": -0.1, "highest_rad": 0.2},
        "columns": {"count": 8, "first_rad": 0.0, "span_rad": 1.4, "endpoint": True},
        "rate_hz": 10.0,
        "scan_duration_s": 0.1,
        "range_min_m": 0.1,
        "range_max_m": 50.0,
        "noise_sigma_m": 0.01,
    } | changes


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_sensors_see_all_round_with_unit_rays_lowest_beam_first(name: str) -> None:
    sensor = load_sensor(name)
    directions = sensor.directions_S()
    assert sensor.wraps
    assert directions.shape == (len(sensor.elevations), sensor.columns.count, 3)
    assert np.linalg.norm(directions, axis=-1) == pytest.approx(1.0, abs=1e-6)
    assert (np.diff(directions[:, 0, 2]) < 0).all()  # frame S: z is down


def test_a_full_turn_with_an_endpoint_fires_twice_into_one_column() -> None:
    sensor = load_sensor("vrx32")
    assert sensor.columns.count == 2187
    assert sensor.image_shape == (32, 2186)
    assert sensor.azimuth_step == pytest.approx(2 * math.pi / 2186)
    rays = sensor.directions_S()
    assert rays[:, 0] == pytest.approx(rays[:, -1], abs=1e-6)


def test_a_counter_clockwise_description_becomes_clockwise_from_forward() -> None:
    sensor = convert(description(), Sensor)
    assert not sensor.wraps
    assert sensor.azimuths == pytest.approx(-0.2 * np.arange(8))
    assert sensor.first_azimuth == pytest.approx(-1.4)
    port = sensor.directions_S()[0, -1]
    assert port[1] < 0  # frame S: y is starboard, the last ray points to port


def test_time_runs_from_the_first_firing_to_the_last() -> None:
    assert convert(description(), Sensor).time_offsets[[0, -1]] == pytest.approx([0.0, 0.1])
    late = convert(description(stamp_fraction=1.0), Sensor)
    assert late.time_offsets[[0, -1]] == pytest.approx([-0.1, 0.0])


def test_a_mount_typed_in_flu_is_given_in_frd() -> None:
    mount = Mount(x_m=1.0, y_m=2.0, z_m=3.0, pitch_rad=0.1, yaw_rad=0.2)
    sensor = convert(description(), Sensor).mounted(mount)
    assert sensor.mount_position_B == pytest.approx([1.0, -2.0, -3.0])
    forward_B = sensor.R_BS @ np.array([1.0, 0.0, 0.0])
    assert forward_B[1] < 0  # yaw to port
    assert forward_B[2] > 0  # positive pitch turns the forward ray down


def test_a_sensor_without_a_mount_says_so() -> None:
    with pytest.raises(ConfigError, match="'test' has no mount"):
        _ = convert(description(), Sensor).R_BS


def test_listed_elevations_are_sorted() -> None:
    sensor = convert(description(beams={"elevations_deg": [2.0, -1.0, 5.0]}), Sensor)
    assert np.degrees(sensor.elevations) == pytest.approx([-1.0, 2.0, 5.0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"beams": {"count": 4}}, "either count"),
        ({"beams": {"count": 4, "elevations_deg": [1.0, 2.0]}}, "either count"),
        ({"beams": {"elevations_deg": [1.0, 1.0]}}, "distinct"),
        ({"beams": {"elevations_deg": [1.0]}}, "distinct"),
        ({"range_min_m": 60.0}, "range_max_m"),
        ({"columns": {"count": 8, "first_rad": 0.0, "span_rad": 0.0, "endpoint": True}}, "zero"),
        ({"columns": {"count": 8, "first_rad": 0.0, "span_rad": 7.0, "endpoint": True}}, "span"),
        ({"mount": {"x_m": 700.0, "y_m": 0.0, "z_m": 1.0}}, "mount.x_m"),  # millimetres
        ({"mount": {"x_m": 0.7, "y_m": 0, "z_m": 1, "roll_rad": 180.0}}, "mount.roll_rad"),
        ({"beams": {"count": 10**9, "lowest_rad": -0.2, "highest_rad": 0.2}}, "beams.count"),
        (
            {"columns": {"count": 10**9, "first_rad": 0.0, "span_rad": 6.0, "endpoint": True}},
            "columns.count",
        ),
        (
            {"columns": {"count": 8, "first_rad": 180.0, "span_rad": 6.0, "endpoint": True}},
            "columns.first_rad",
        ),
        ({"scan_duration_s": 100.0}, "scan_duration_s"),  # milliseconds
        ({"typo": 1}, "unknown key"),
    ],
)
def test_a_description_that_no_scan_can_fit_is_refused(
    change: dict[str, object], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        _ = convert(description(**change), Sensor).elevations

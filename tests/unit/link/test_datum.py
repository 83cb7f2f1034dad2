"""Places on the earth in a local frame."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.datum import EARTH_RADIUS_M, Datum, from_datum_N

SYDNEY = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)


def test_the_datum_itself_is_the_origin() -> None:
    assert from_datum_N(SYDNEY, -33.7221, 150.6739).tolist() == [0.0, 0.0, 0.0]


def test_a_minute_of_latitude_is_a_sea_mile_to_the_north() -> None:
    north, east, down = from_datum_N(SYDNEY, -33.7221 + 1 / 60, 150.6739)
    assert north == pytest.approx(1852.0, rel=0.002)
    assert (east, down) == (0.0, 0.0)


def test_the_date_line_is_no_wall() -> None:
    fiji = Datum(latitude_deg=-17.0, longitude_deg=179.9999)
    assert from_datum_N(fiji, -17.0, -179.9999)[1] == pytest.approx(21.29, abs=0.05)


@given(
    st.floats(-70.0, 70.0),
    st.floats(-math.pi, math.pi),
    st.floats(1.0, 5000.0),
)
def test_distances_are_those_on_the_sphere(latitude_deg, bearing, distance_m) -> None:
    """Against the haversine formula, for a place some way along a bearing."""
    datum = Datum(latitude_deg=latitude_deg, longitude_deg=10.0)
    north, east = distance_m * math.cos(bearing), distance_m * math.sin(bearing)
    place = (
        latitude_deg + math.degrees(north / EARTH_RADIUS_M),
        10.0 + math.degrees(east / EARTH_RADIUS_M / math.cos(math.radians(latitude_deg))),
    )
    got = from_datum_N(datum, *place)
    assert math.hypot(got[0], got[1]) == pytest.approx(haversine_m(datum, *place), abs=0.02)


def haversine_m(datum: Datum, latitude_deg: float, longitude_deg: float) -> float:
    a, b = math.radians(datum.latitude_deg), math.radians(latitude_deg)
    turned = math.radians(longitude_deg - datum.longitude_deg)
    h = math.sin((b - a) / 2) ** 2 + math.cos(a) * math.cos(b) * math.sin(turned / 2) ** 2
    return 2.0 * EARTH_RADIUS_M * math.asin(math.sqrt(h))


@pytest.mark.parametrize("values", [{"latitude_deg": 91.0}, {"longitude_deg": 181.0}])
def test_a_place_that_is_not_on_the_earth_is_refused(values) -> None:
    place = {"latitude_deg": 0.0, "longitude_deg": 0.0} | values
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(place, Datum)

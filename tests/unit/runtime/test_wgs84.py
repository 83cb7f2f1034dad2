"""Places on the earth and positions in a local frame: exact both ways."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.datum import EARTH_RADIUS_M, FLATTENING, LocalFrame, Place

ORIGINS = st.builds(
    Place,
    latitude_deg=st.floats(-89.0, 89.0),
    longitude_deg=st.floats(-180.0, 180.0),
    altitude_m=st.floats(-100.0, 4000.0),
)
OFFSETS_N = st.tuples(*[st.floats(-20_000.0, 20_000.0)] * 2, st.floats(-500.0, 500.0))


@given(origin=ORIGINS, offset_N=OFFSETS_N)
def test_there_and_back_is_the_same_position(origin, offset_N):
    frame = LocalFrame(origin)
    again_N = frame.position_N(frame.place(np.array(offset_N)))
    np.testing.assert_allclose(again_N, offset_N, atol=1e-6)


@given(origin=ORIGINS)
def test_the_origin_is_at_the_origin(origin):
    np.testing.assert_allclose(LocalFrame(origin).position_N(origin), 0.0, atol=1e-8)


@given(origin=ORIGINS, offset_N=OFFSETS_N)
def test_straight_lines_have_their_length(origin, offset_N):
    """Compared with the chord in the earth-fixed frame, by a formula of its own."""
    frame = LocalFrame(origin)
    chord_m = math.dist(earth_fixed(origin), earth_fixed(frame.place(np.array(offset_N))))
    assert chord_m == pytest.approx(np.linalg.norm(offset_N), abs=1e-5)


def earth_fixed(place: Place) -> tuple[float, float, float]:
    """By the reduced latitude, tan(beta) = (1 - f) tan(phi)."""
    phi, lam = math.radians(place.latitude_deg), math.radians(place.longitude_deg)
    beta = math.atan((1.0 - FLATTENING) * math.tan(phi))
    across_m = EARTH_RADIUS_M * math.cos(beta) + place.altitude_m * math.cos(phi)
    z_m = EARTH_RADIUS_M * (1.0 - FLATTENING) * math.sin(beta) + place.altitude_m * math.sin(phi)
    return across_m * math.cos(lam), across_m * math.sin(lam), z_m


@pytest.mark.parametrize("latitude_deg", [-60.0, -33.7221, 0.0, 45.0])
def test_a_little_way_north_and_east_is_that_of_the_radii_of_curvature(latitude_deg):
    """Snyder (1987), Map Projections, eqs. 4-18 and 4-20: M along the meridian, N across it."""
    frame = LocalFrame(Place(latitude_deg=latitude_deg, longitude_deg=10.0))
    e2 = FLATTENING * (2 - FLATTENING)
    phi, step = math.radians(latitude_deg), math.radians(1e-4)
    w = 1 - e2 * math.sin(phi) ** 2
    north = frame.position_N(Place(latitude_deg=latitude_deg + 1e-4, longitude_deg=10.0))
    east = frame.position_N(Place(latitude_deg=latitude_deg, longitude_deg=10.0 + 1e-4))
    assert north[0] == pytest.approx(step * EARTH_RADIUS_M * (1 - e2) / w**1.5, rel=1e-6)
    assert east[1] == pytest.approx(step * EARTH_RADIUS_M * math.cos(phi) / w**0.5, rel=1e-6)


def test_a_sphere_would_be_wrong_by_metres_a_kilometre():
    """Why a fix does not go through the autopilot's flat earth (link/datum.py)."""
    frame = LocalFrame(Place(latitude_deg=-33.7221, longitude_deg=150.6739))
    place = frame.place(np.array([1000.0, 0.0, 0.0]))
    flat_m = EARTH_RADIUS_M * math.radians(place.latitude_deg + 33.7221)
    assert flat_m == pytest.approx(1003.6, abs=0.2)


def test_across_the_date_line_is_near():
    frame = LocalFrame(Place(latitude_deg=-17.0, longitude_deg=179.9999))
    place = Place(latitude_deg=-17.0, longitude_deg=-179.9999)
    assert np.hypot(*frame.position_N(place)[:2]) < 30.0

"""Tracked vessels as AIS_VESSEL."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.datum import Datum, from_datum_N
from twinscrew.runtime.ground.report import ais_vessels, mmsi
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages.types import Tracks

SYDNEY = Datum(latitude_deg=-33.7221, longitude_deg=150.6739)


def tracks(*rows: tuple[int, float, float, float, float, float, float]) -> Tracks:
    """Rows of id, north, east, north speed, east speed, radius, age."""
    values = np.array(rows, dtype=float).reshape(-1, 7)
    return Tracks(
        stamp_ns=0,
        id=values[:, 0].astype(np.int64),
        p_N=values[:, 1:3],
        v_N=values[:, 3:5],
        radius=values[:, 5],
        covariance=np.zeros((len(values), 4, 4)),
        age_s=values[:, 6],
    )


def told(*rows) -> list:
    """What arrives at a station."""
    sender, ear = Wire(3, 191), Wire(9, 9)
    frames = [sender.encode(m) for m in ais_vessels(tracks(*rows), SYDNEY, 3, 0.5)]
    return [message for frame in frames for message in ear.decode(frame)]


def test_a_moving_track_is_a_vessel_at_its_place_with_its_course_and_speed() -> None:
    (vessel,) = told((17, 100.0, -50.0, 0.0, -2.5, 3.2, 0.0))
    place = from_datum_N(SYDNEY, vessel.lat * 1e-7, vessel.lon * 1e-7)
    assert tuple(place[:2]) == pytest.approx((100.0, -50.0), abs=0.02)
    assert (vessel.COG, vessel.heading, vessel.velocity) == (27_000, 27_000, 250)
    assert vessel.MMSI == 100_003_017
    assert vessel.name == "track 17"
    assert (vessel.dimension_bow, vessel.dimension_starboard) == (4, 4)
    known = mavlink.AIS_FLAGS_VALID_COG | mavlink.AIS_FLAGS_VALID_VELOCITY
    assert vessel.flags & known == known
    assert not vessel.flags & (mavlink.AIS_FLAGS_VALID_TURN_RATE | mavlink.AIS_FLAGS_VALID_CALLSIGN)


@pytest.mark.parametrize(("north", "east", "course"), [(1, 0, 0), (0, 1, 9000), (-1, 0, 18_000)])
def test_courses_are_clockwise_from_north(north, east, course) -> None:
    (vessel,) = told((1, 0.0, 0.0, north, east, 1.0, 0.0))
    assert course == vessel.COG


def test_what_stands_still_or_was_lost_is_no_vessel() -> None:
    still, lost = (1, 5.0, 5.0, 0.3, 0.3, 1.0, 0.0), (2, 5.0, 9.0, 2.0, 0.0, 1.0, 5.0)
    assert told(still, lost) == []
    assert len(told(still, lost, (3, 9.0, 9.0, 0.6, 0.0, 1.0, 0.4))) == 1


def test_numbers_differ_between_vessels_of_one_boat_and_of_several() -> None:
    numbers = {mmsi(system, track) for system in range(1, 256) for track in range(1000)}
    assert len(numbers) == 255 * 1000
    assert all(100_000_000 < number < 101_000_000 for number in numbers)


@pytest.mark.parametrize(
    ("place", "speed", "radius"),
    [
        ((4e7, 0.0), 2.0, 1.0),
        ((0.0, -4e300), 2.0, 1.0),
        ((np.inf, 0.0), 2.0, 1.0),
        ((0.0, np.nan), 2.0, 1.0),
        ((0.0, 0.0), np.inf, 1.0),
        ((0.0, 0.0), 2.0, np.nan),
    ],
)
def test_what_the_message_cannot_say_is_left_out(place, speed, radius) -> None:
    known = (1, 5.0, 5.0, 2.0, 0.0, 1.0, 0.0)
    assert len(told((7, *place, speed, 0.0, radius, 0.0), known)) == 1


@pytest.mark.parametrize("radius", [0.0, 1e9])
def test_any_place_on_earth_and_any_size_can_be_said(radius) -> None:
    places = [(1, 1e6 * k, -2e6 * k, 1e6, 0.0, radius, 0.0) for k in range(1, 9)]
    assert len(told(*places)) == len(places)

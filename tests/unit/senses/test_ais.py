"""AIS: what vessels say of themselves, against another decoder's reading, and what can be wrong."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyais import encode_dict

from twinscrew.runtime.datum import Datum, from_datum_N, to_degrees
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages.marine import Sentence, encode_sentence
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.senses.ais import KNOT_MPS, Ais, AisSettings

DATA = Path(__file__).parents[2] / "data" / "ais"
DATUM = Datum(latitude_deg=63.44, longitude_deg=10.40)
EPOCH_NS = 1_735_689_600 * 10**9
EVERYWHERE = AisSettings(datum=DATUM, max_range_m=1e9)


def stamp(t: float) -> int:
    return EPOCH_NS + round(t * 1e9)


def own(p_N=(0.0, 0.0), v_B=(0.0, 0.0)) -> Odometry:
    return Odometry(
        stamp_ns=stamp(0),
        position_N=np.array([*p_N, 0.0]),
        q_NB=np.array([1.0, 0.0, 0.0, 0.0]),
        velocity_B=np.array([*v_B, 0.0]),
        rates_B=np.zeros(3),
    )


class Receiver:
    """An AIS receiver in a boat that lies at the datum, or moves."""

    def __init__(self, **more) -> None:
        self.ais = Ais(AisSettings(datum=DATUM, **more))
        self.own = own()
        self.events: list = []

    def hears(self, t: float, text: str):
        payload = encode_sentence(Sentence(stamp_ns=stamp(t), text=text))
        heard = self.ais.take(payload, stamp(t), lambda _ns: self.own)
        self.events += heard.events
        return list(heard.looks)

    def report(self, t, p_N, v_N, *, age=0.0, mmsi=257123450, kind="VDM", **more):
        """A report of class A whose position was taken `age` ago, at a full second."""
        latitude, longitude = to_degrees(DATUM, np.array(p_N, float))
        fields = {
            "type": 1,
            "mmsi": mmsi,
            "lat": latitude,
            "lon": longitude,
            "speed": math.hypot(*v_N) / KNOT_MPS,
            "course": math.degrees(math.atan2(v_N[1], v_N[0])) % 360.0,
            "heading": 511,
            "second": int(t - age) % 60,
            "accuracy": 1,
        } | more
        looks = []
        for text in encode_dict(fields, talker_id="AI", sentence_type=kind):
            looks += self.hears(t, text)
        return looks

    def static(self, t, **fields):
        for text in encode_dict(
            {"type": 5, "mmsi": 257123450} | fields, talker_id="AI", sentence_type="VDM"
        ):
            assert all(look.extras[0].names_only for look in self.hears(t, text))

    def waits(self, begin: int, end: int) -> None:
        for t in range(begin, end):
            self.events += self.ais.step(stamp(t), forgotten=False).events

    @property
    def names(self) -> set[str]:
        return {event.name for event in self.events}


def test_every_sentence_is_read_as_gpsd_reads_it():
    """gpsdecode 3.22 made gpsd.jsonl of sentences.txt: public examples, and pyais' own."""
    ais = Ais(EVERYWHERE)
    for text in (DATA / "sentences.txt").read_text().splitlines():
        payload = encode_sentence(Sentence(stamp_ns=stamp(0), text=text))
        heard = ais.take(payload, stamp(0), lambda _ns: None)
        assert "ais_malformed" not in {event.name for event in heard.events}
    found = ais.targets(stamp(0))
    assert found is not None
    rows = {int(number): k for k, number in enumerate(found.id)}
    theirs = [json.loads(line) for line in (DATA / "gpsd.jsonl").read_text().splitlines()]
    positions = [each for each in theirs if "lat" in each]
    names = {each["mmsi"]: each["shipname"] for each in theirs if "shipname" in each}
    names |= {each["mmsi"]: each["name"] for each in theirs if "name" in each}
    assert len(positions) >= 15
    for each in positions:
        k = rows[each["mmsi"]]
        moving = each.get("speed", 0.0)
        known = isinstance(moving, float) and moving < 102.3
        course = each.get("course", 360.0)
        v_N = np.zeros(2)
        if known and course < 360.0:
            towards = math.radians(course)
            v_N = moving * KNOT_MPS * np.array([math.cos(towards), math.sin(towards)])
        np.testing.assert_allclose(found.v_N[k], v_N, atol=0.01)
        if not v_N.any():  # nothing is extrapolated: the antenna, or the middle beside it
            p_N = from_datum_N(DATUM, each["lat"], each["lon"])[:2]
            assert np.hypot(*(found.p_N[k] - p_N)) < 10.1
        assert found.name[k].startswith(f"{each['mmsi']:09d}")
        assert names.get(each["mmsi"], "") in found.name[k]
    k = rows[257000100]
    assert (found.half_length[k], found.half_beam[k]) == (50.0, 9.0)  # 60 + 40, 8 + 10


@pytest.mark.parametrize("age", [0.0, 2.0, 12.0])
def test_a_ship_is_where_it_is_now_however_old_its_report_is(age):
    boat = Receiver()
    t, v_N = 30.0, np.array([3.0, -4.0])
    where = np.array([200.0, 100.0])
    (look,) = boat.report(t, where - v_N * age, v_N, age=age)
    np.testing.assert_allclose(look.z[0], where, atol=0.2 + 0.03 * age)
    np.testing.assert_allclose(look.extras[0].v_N, v_N, atol=0.05)
    (fresh,) = Receiver().report(t, where, v_N)
    assert look.R[0, 0, 0] >= fresh.R[0, 0, 0]


def test_the_middle_of_the_hull_is_tracked_not_the_antenna_and_heading_is_not_course():
    boat = Receiver()
    boat.static(1.0, shipname="NORDLYS", to_bow=90, to_stern=10, to_port=15, to_starboard=5)
    (look,) = boat.report(2.0, (0.0, 500.0), (2.0, 0.0), heading=90)
    # The bow points east: the middle is 40 m east of the antenna, and 5 m to port of it: north.
    np.testing.assert_allclose(look.z[0], (5.0, 540.0), atol=0.3)
    named = look.extras[0].named
    assert named.name == "257123450 NORDLYS"
    assert (named.half_length_m, named.half_beam_m) == (50.0, 10.0)
    assert named.heading == pytest.approx(math.pi / 2)
    np.testing.assert_allclose(look.extras[0].v_N, (2.0, 0.0), atol=0.05)


def test_name_and_size_are_told_as_soon_as_they_are_known():
    boat = Receiver()
    assert boat.report(1.0, (0.0, 500.0), (2.0, 0.0))
    fields = {"type": 5, "mmsi": 257123450, "shipname": "NORDLYS", "to_bow": 60, "to_stern": 40}
    texts = encode_dict(fields, talker_id="AI", sentence_type="VDM")
    (look,) = [look for text in texts for look in boat.hears(2.0, text)]
    assert look.extras[0].names_only
    assert look.extras[0].named.name == "257123450 NORDLYS"


def test_a_course_stands_in_for_a_heading_only_of_what_moves():
    (moving,) = Receiver().report(2.0, (0.0, 500.0), (0.0, 5.0))
    (lying,) = Receiver().report(2.0, (0.0, 500.0), (0.0, 0.2))
    assert moving.extras[0].named.heading == pytest.approx(math.pi / 2, abs=0.02)
    assert math.isnan(lying.extras[0].named.heading)


def test_a_jump_is_reported_and_not_used_until_three_reports_agree():
    boat = Receiver()
    for k in range(3):
        assert boat.report(10.0 * k, (0.0, 100.0 + 40.0 * k), (0.0, 4.0))
    assert not boat.report(30.0, (3000.0, 0.0), (0.0, 4.0))
    assert boat.names == {"ais_jump"}
    assert not boat.report(40.0, (3000.0, 40.0), (0.0, 4.0))
    (look,) = boat.report(50.0, (3000.0, 80.0), (0.0, 4.0))
    assert look.extras[0].named.identity == "257123450"
    assert "ais_duplicate" not in boat.names


def test_two_ships_with_one_number_are_two_vessels():
    boat, used = Receiver(), []
    for k in range(6):
        t = 10.0 * k
        used += boat.report(t, (0.0, 100.0 + 4.0 * t), (0.0, 4.0))
        used += boat.report(t + 5.0, (2000.0, -300.0 - 4.0 * t), (0.0, -4.0))
    assert "ais_duplicate" in boat.names
    assert {look.extras[0].named.identity for look in used} == {"257123450", "257123450 (2)"}
    errors = [min(abs(look.z[0][0]), abs(look.z[0][0] - 2000.0)) for look in used]
    assert max(errors) < 1.0


@pytest.mark.parametrize("lie", ["speed", "way"])
def test_what_no_ship_can_do_is_called_spoofed(lie):
    boat = Receiver()
    for k in range(6):
        v_N = (0.0, 45.0) if lie == "speed" else (0.0, 0.0)
        boat.report(10.0 * k, (500.0 + 60.0 * k * (lie == "way"), 0.0), v_N)
    assert "ais_spoofed" in boat.names


def test_who_falls_silent_is_stale_and_then_lost():
    boat = Receiver()
    boat.report(0.0, (0.0, 300.0), (0.0, 5.0))
    boat.waits(0, 20)
    assert boat.names == set()
    boat.waits(20, 40)
    assert boat.names == {"ais_stale"}
    assert boat.ais.targets(stamp(40)) is not None
    boat.waits(40, 60)
    assert boat.names == {"ais_stale", "ais_lost"}
    assert boat.ais.targets(stamp(60)) is None


def test_a_clock_that_is_set_back_leaves_no_ship_that_never_grows_old():
    boat = Receiver()
    boat.report(3600.0, (0.0, 300.0), (0.0, 5.0))
    boat.waits(0, 2)
    assert boat.ais.targets(stamp(1)) is None


def test_a_ship_at_anchor_may_be_silent_for_minutes():
    boat = Receiver()
    boat.report(0.0, (0.0, 300.0), (0.0, 0.0), status=1)
    boat.waits(0, 300)
    assert boat.names == set()


@pytest.mark.parametrize("how", ["VDO", "number", "place"])
def test_the_own_vessel_is_never_a_target(how):
    boat = Receiver(own_mmsi=257123450) if how == "number" else Receiver()
    kind = "VDO" if how == "VDO" else "VDM"
    for t in range(0, 60, 10):
        boat.own = own((3.0 * t, 0.0), (3.0, 0.0))
        assert not boat.report(float(t), (3.0 * t + 2.0, 1.0), (3.0, 0.0), kind=kind)
    assert how == "VDO" or boat.names == {"ais_own_echo"}


def test_somebody_else_under_the_own_number_is_reported():
    boat = Receiver(own_mmsi=257123450)
    assert not boat.report(0.0, (5000.0, 0.0), (0.0, 3.0))
    assert boat.names == {"ais_duplicate"}


def test_a_flood_costs_a_bounded_number_of_readings_and_one_event():
    boat = Receiver(most_per_s=50.0)
    used = sum(
        len(boat.report(1.0 + k / 2000.0, (0.0, 300.0 + k), (0.0, 1.0), mmsi=257000000 + k))
        for k in range(600)
    )
    assert used <= 50 + 0.3 * 50 + 1
    assert [event.name for event in boat.events] == ["ais_flood"]


def test_memory_is_bounded_whoever_reports():
    boat = Receiver(most_targets=20, most_per_s=1e6)
    for k in range(200):
        boat.report(0.01 * k, (100.0, 300.0), (0.0, 1.0), mmsi=257000000 + k)
        boat.hears(0.01 * k, f"!AIVDM,2,1,{k % 10},{'AB'[k % 2]},{k},0*00")
    found = boat.ais.targets(stamp(2))
    assert found is not None
    assert len(found.id) == 20
    assert len(boat.ais._parts) <= 16


def test_base_stations_and_virtual_aids_have_nothing_in_the_water():
    boat = Receiver()
    latitude, longitude = to_degrees(DATUM, np.array([50.0, 50.0]))
    place = {"lat": latitude, "lon": longitude}
    aid = {"type": 21, "mmsi": 992570001, "name": "X", "aid_type": 14, **place}

    def heard(fields):
        texts = encode_dict(fields, talker_id="AI", sentence_type="VDM")
        return [look for text in texts for look in boat.hears(1.0, text)]

    assert not heard({"type": 4, "mmsi": 2570001, **place})
    assert not heard({**aid, "mmsi": 992570002, "virtual_aid": 1})
    (look,) = heard(aid)
    np.testing.assert_allclose(look.z[0], (50.0, 50.0), atol=0.3)
    assert look.extras[0].v_N.tolist() == [0.0, 0.0]


def test_after_the_tracker_has_forgotten_all_it_is_told_again():
    boat = Receiver()
    boat.report(0.0, (0.0, 300.0), (0.0, 5.0))
    assert not boat.ais.step(stamp(4), forgotten=False).looks
    (look,) = boat.ais.step(stamp(8), forgotten=True).looks
    np.testing.assert_allclose(look.z[0], (0.0, 340.0), atol=0.5)
    assert look.stamp_ns == stamp(8)


def test_ais_without_a_datum_is_refused():
    with pytest.raises(ValueError, match="datum"):
        Ais(AisSettings())


@settings(max_examples=300, deadline=None)
@given(st.one_of(st.text(max_size=120), st.binary(max_size=60).map(lambda b: b.decode("latin-1"))))
def test_no_text_whatever_harms(text):
    ais = Ais(AisSettings(datum=DATUM))
    for start in ("", "!AIVDM,1,1,,A,", "!AIVDM,2,1,1,A,"):
        try:
            payload = encode_sentence(Sentence(stamp_ns=stamp(0), text=start + text))
            heard = ais.take(payload, stamp(0), lambda _ns: None)
        except MessageError:
            continue
        assert not heard.looks
        assert {event.name for event in heard.events} <= {"ais_malformed"}


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_a_damaged_sentence_is_never_used(data):
    good = "!AIVDM,1,1,,A,13m62@OP1>big7?de4drV`L1P000,0*71"
    at = data.draw(st.integers(7, len(good) - 4))
    other = data.draw(
        st.characters(min_codepoint=33, max_codepoint=126).filter(lambda c: c != good[at])
    )
    ais = Ais(EVERYWHERE)
    payload = encode_sentence(Sentence(stamp_ns=stamp(0), text=good[:at] + other + good[at + 1 :]))
    assert not ais.take(payload, stamp(0), lambda _ns: None).looks

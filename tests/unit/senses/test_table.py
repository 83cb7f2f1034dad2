"""A new position sensor is one file, its settings, and one line in a table."""

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from pyais import encode_dict
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.datum import Datum, to_degrees
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.link.ardupilot.ais import ais_sentences
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.marine import RadarScan, Sentence, decode_radar_scan
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.messages.types import Odometry, PointCloud
from twinscrew.runtime.senses.ais import Ais, AisSettings
from twinscrew.runtime.senses.sense import NOTHING, Heard, Sense, SenseSettings
from twinscrew.runtime.senses.table import SensesSettings, fitted, make_senses, sense_topics
from twinscrew.runtime.settings import convert
from twinscrew.runtime.tracking.detections import SourceSettings, positions
from twinscrew.runtime.vessel.config import RuntimeConfig, inputs_of
from twinscrew.runtime.vessel.vessel import make_vessel

DATUM = Datum(latitude_deg=63.44, longitude_deg=10.40)
START_NS = 1_735_689_600 * 10**9
SCAN_NS = 10**8


class SonarSettings(SenseSettings, frozen=True, kw_only=True):
    """A forward-looking sonar: the new sensor."""

    topic: ClassVar[str] = "radar"  # it happens to speak the same message
    source: ClassVar[SourceSettings] = SourceSettings(clutter=1e-6)
    sigma_m: float = 0.5

    def make(self, name: str) -> Sense:
        return Sonar(self, name)


class Sonar:
    """The whole of it."""

    def __init__(self, settings, name):
        self.settings, self.name = settings, name

    def take(self, payload, latest_ns, own_at):
        scan, own = decode_radar_scan(payload), own_at(latest_ns)
        towards = scan.bearing_rad + own.heading
        own_N = own.position_N[:2]
        offset = scan.range_m[:, None] * np.column_stack([np.cos(towards), np.sin(towards)])
        look = positions(
            own_N + offset,
            own_N,
            sigma_m=self.settings.sigma_m,
            sigma_rad=0.02,
            stamp_ns=scan.stamp_ns,
            source=self.name,
        )
        return Heard((look,))

    def step(self, stamp_ns, *, forgotten):
        return NOTHING

    def targets(self, stamp_ns):
        return None


class WithSonar(SensesSettings, frozen=True, kw_only=True):
    """The table with one line more."""

    sonar: SonarSettings | None = None


def scan(k: int) -> bytes:
    """A LiDAR scan that shows nothing but a distant echo that moves, so that it is not frozen."""
    points = np.array([[40.0, 0.001 * k, 0.0], [41.0, 1.0, 0.0]], np.float32)
    cloud = PointCloud(
        stamp_ns=START_NS + k * SCAN_NS,
        frame_id="lidar",
        points_S=points,
        ring=np.array([0, 1], np.uint16),
    )
    return cdr.encode_point_cloud(cloud)


def odometry(k: int) -> bytes:
    return cdr.encode_odometry(
        Odometry(
            stamp_ns=START_NS + k * SCAN_NS,
            position_N=np.array([0.1 * k, 0.0, 0.0]),
            q_NB=quaternion_from_euler(0.0, 0.0, 0.0),
            velocity_B=np.array([1.0, 0.0, 0.0]),
            rates_B=np.zeros(3),
        )
    )


def plots(k: int, p_N) -> bytes:
    offset = np.array(p_N) - (0.1 * k, 0.0)
    return cdr.encode_radar_scan(
        RadarScan(
            stamp_ns=START_NS + k * SCAN_NS,
            range_m=np.array([np.hypot(*offset)]),
            bearing_rad=np.array([math.atan2(offset[1], offset[0])]),
            elevation_rad=np.zeros(1),
            doppler_mps=np.zeros(1),
            amplitude=np.ones(1),
        )
    )


def sentences(k: int, p_N, v_N=(0.0, -4.0)):
    latitude, longitude = to_degrees(DATUM, np.array(p_N))
    fields = {
        "type": 1,
        "mmsi": 257123450,
        "lat": latitude,
        "lon": longitude,
        "speed": math.hypot(*v_N) * 3600 / 1852,
        "course": math.degrees(math.atan2(v_N[1], v_N[0])) % 360,
        "heading": 511,
        "second": (k // 10) % 60,
        "accuracy": 1,
    }
    for text in encode_dict(fields, talker_id="AI", sentence_type="VDM"):
        yield cdr.encode_sentence(Sentence(stamp_ns=START_NS + k * SCAN_NS, text=text))


def sail(config, messages, scans=40, blind=range(0)):
    """Give the vessel odometry, what `messages` gives for a step, and a scan; and what came.

    In the steps `blind` there is no scan.
    """
    vessel, outs = make_vessel(config), []
    for k in range(scans):
        seen = [] if k in blind else [("points", scan(k))]
        for topic, payload in (("odometry", odometry(k)), *messages(k), *seen):
            outs.append(vessel.handle(Received(topic, payload, 0), 0.1 * k))
    return vessel, outs


def decisions(outs):
    return [out.decision for out in outs if out.decision is not None]


def test_a_new_sensor_reaches_the_decision_by_one_line_in_the_table():
    config = RuntimeConfig(senses=WithSonar(sonar=SonarSettings()))
    assert "radar" in inputs_of(config)
    ship = np.array([60.0, 30.0])
    _, outs = sail(config, lambda k: [("radar", plots(k, ship))] if k % 3 == 0 else [])
    tracks = decisions(outs)[-1].tracks
    np.testing.assert_allclose(tracks.p_N, [ship], atol=1.0)


def test_what_a_vessel_does_not_have_it_leaves_alone():
    _, outs = sail(RuntimeConfig(), lambda k: [("radar", plots(k, (60.0, 30.0)))], 5)
    assert not any(len(d.tracks.id) for d in decisions(outs))
    assert not any(e.name in ("internal_error", "bad_message") for out in outs for e in out.events)


def test_ais_reaches_decision_alarm_and_targets():
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))
    meets = lambda k: (100.0, 360.0 - 0.4 * k)  # noqa: E731  (where both are after 90 s)

    def messages(k):
        return [("nmea", payload) for payload in sentences(k, meets(k))] if k % 50 == 0 else []

    _, outs = sail(config, messages, 130)
    decided = decisions(outs)
    assert decided[-1].tracks.name == ("257123450",)
    events = [event for d in decided for event in d.events]
    (alarm,) = [event for event in events if event.name == "collision_course"]
    assert "257123450" in alarm.detail
    targets = [out.targets for out in outs if out.targets is not None]
    assert targets[-1].name == ("257123450",)


@pytest.mark.parametrize("first_blind", [0, 30])
def test_a_ship_is_announced_though_the_lidar_sends_nothing(first_blind):
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))

    def messages(k):
        p_N = (100.0, 360.0 - 0.4 * k)
        return [("nmea", payload) for payload in sentences(k, p_N)] if k % 50 == 0 else []

    _, outs = sail(config, messages, 130, blind=range(first_blind, 130))
    events = [event for out in outs for event in out.events]
    (alarm,) = [event for event in events if event.name == "collision_course"]
    assert "257123450" in alarm.detail
    seconds = (alarm.stamp_ns - START_NS) / 1e9
    assert seconds < 13.0
    targets = [out.targets for out in outs if out.targets is not None]
    assert targets[-1].stamp_ns > START_NS + 11 * 10**9
    assert targets[-1].name == ("257123450",)


def test_scans_that_come_again_find_the_ship_where_it_is():
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))

    def messages(k):
        p_N = (100.0, 360.0 - 0.4 * k)
        return [("nmea", payload) for payload in sentences(k, p_N)] if k % 50 == 0 else []

    _, outs = sail(config, messages, 130, blind=range(30, 60))
    decided = decisions(outs)
    ships = [d.tracks for d in decided[35:]]
    assert {tracks.name for tracks in ships} == {("257123450",)}
    assert len({int(tracks.id[0]) for tracks in ships}) == 1
    np.testing.assert_allclose(ships[-1].p_N, [(100.0, 360.0 - 0.4 * 129)], atol=2.0)


def test_odometry_that_is_a_little_older_than_the_last_scan_is_no_gap_in_the_scans():
    """Else alarms would forget at each such message whom the LiDAR alone sees."""
    vessel = make_vessel(RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM))))
    listened = []
    listen = vessel.pipeline.senses.listen
    vessel.pipeline.senses.listen = lambda stamp_ns: listened.append(stamp_ns) or listen(stamp_ns)
    for k in range(1, 30):
        late = replace(
            cdr.decode_odometry(odometry(k)), stamp_ns=START_NS + k * SCAN_NS - 5 * 10**7
        )
        vessel.handle(Received("points", scan(k), 0), 0.1 * k)
        vessel.handle(Received("odometry", cdr.encode_odometry(late), 0), 0.1 * k)
    scans = [START_NS + k * SCAN_NS for k in range(1, 30)]
    assert len(listened) > 25
    assert set(listened) <= set(scans)


def test_bytes_that_are_no_message_are_an_event_and_nothing_else():
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))
    _, outs = sail(config, lambda k: [("nmea", b"\x00\x01\x00\x00" + bytes([k] * 9))], 3)
    names = [event.name for out in outs for event in out.events]
    assert names.count("bad_message") == 3
    assert "internal_error" not in names


def test_a_look_whose_stamp_is_far_off_is_not_used():
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))

    def messages(k):
        return [("nmea", p) for p in sentences(k + 600, (50.0, 50.0))] if k == 2 else []

    _, outs = sail(config, messages, 6)
    assert any(event.name == "input_late" for out in outs for event in out.events)
    assert not any(len(d.tracks.id) for d in decisions(outs))


def test_ais_without_a_datum_is_refused_before_anything_moves():
    with pytest.raises(ConfigError, match="datum"):
        convert({"senses": {"ais": {}}}, RuntimeConfig)
    convert(
        {
            "senses": {"ais": {}},
            "autopilot": {"datum": {"latitude_deg": 1.0, "longitude_deg": 2.0}},
        },
        RuntimeConfig,
    )


def test_lines_without_anybody_who_reads_them_are_refused():
    with pytest.raises(ConfigError, match="connections"):
        convert({"senses": {"nmea": {"connections": ["udpin:0.0.0.0:10110"]}}}, RuntimeConfig)


def test_two_sensors_share_a_topic():
    both = convert(
        {"ais": {"datum": {"latitude_deg": 1.0, "longitude_deg": 2.0}}, "ttm": {}}, SensesSettings
    )
    assert list(fitted(both)) == ["ais", "ttm"]
    assert sense_topics(both) == ("nmea",)
    assert len(make_senses(both)["nmea"]) == 2


@pytest.mark.parametrize("name", ["nmea", "radar", "detections"])
def test_ros_tools_read_our_messages_and_write_the_same_bytes(name):
    tracks = decisions(
        sail(
            RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM))),
            lambda k: [("nmea", p) for p in sentences(k, (50.0, 50.0))],
            3,
        )[1]
    )[-1].tracks
    payload = {
        "nmea": cdr.encode_sentence(Sentence(stamp_ns=START_NS, text="!AIVDM,1")),
        "radar": plots(0, (30.0, 40.0)),
        "detections": cdr.encode_detections(tracks),
    }[name]
    ros_type = TOPICS[name].ros_type
    message = type_store().deserialize_cdr(payload, ros_type)
    assert bytes(type_store().serialize_cdr(message, ros_type)) == payload
    if name == "detections":
        (found,) = message.detections
        assert found.id == "0"
        assert found.results[0].hypothesis.class_id == "257123450"
        pose = found.results[0].pose
        np.testing.assert_allclose((pose.pose.position.y, pose.pose.position.x), tracks.p_N[0])
        P = pose.covariance.reshape(6, 6)
        assert P[0, 0] == tracks.covariance[0, 1, 1]


def ais_vessel(**more):
    flags = (
        mavlink.AIS_FLAGS_VALID_COG
        | mavlink.AIS_FLAGS_VALID_VELOCITY
        | mavlink.AIS_FLAGS_VALID_DIMENSIONS
        | mavlink.AIS_FLAGS_VALID_NAME
        | mavlink.AIS_FLAGS_POSITION_ACCURACY
    )
    given = {
        "MMSI": 257123450,
        "lat": 634_400_000,
        "lon": 104_050_000,
        "COG": 9000,
        "heading": 8800,
        "velocity": 412,
        "turn_rate": 0,
        "navigational_status": 0,
        "type": 70,
        "dimension_bow": 60,
        "dimension_stern": 40,
        "dimension_port": 8,
        "dimension_starboard": 10,
        "callsign": b"LHCW",
        "name": b"NORDLYS",
        "tslc": 3,
        "flags": flags,
    }
    return mavlink.MAVLink_ais_vessel_message(**(given | more))


def test_what_an_autopilot_forwards_is_what_its_receiver_heard():
    ais = Ais(AisSettings(datum=DATUM))
    told = ais_sentences(ais_vessel())
    assert {age for age, _ in told} == {3.0}
    for _, text in told:
        ais.take(cdr.encode_sentence(Sentence(stamp_ns=START_NS, text=text)), 0, lambda _: None)
    targets = ais.targets(START_NS)
    assert targets.name == ("257123450 NORDLYS",)
    np.testing.assert_allclose(targets.v_N[0], (0.0, 4.12), atol=0.03)
    assert (targets.half_length[0], targets.half_beam[0]) == (50.0, 9.0)
    # 0.0005 degrees east; the middle lies 10 m ahead and 1 m to starboard of the antenna, and the
    # report's age is not known from its second: one second's way is added.
    assert abs(targets.p_N[0, 1] - (249.0 + 10.0 + 4.12)) < 3.0


@pytest.mark.parametrize("nothing", [{"MMSI": 0}, {"lat": 0, "lon": 0}])
def test_an_empty_report_of_an_autopilot_is_none(nothing):
    assert ais_sentences(ais_vessel(**nothing)) == []


def test_a_sentence_of_a_receiver_is_recorded_as_it_was_said():
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))
    vessel = make_vessel(config)
    (text,) = (cdr.decode_sentence(p).text for p in sentences(1, (50.0, 50.0)))
    assert not vessel.hear(text, 0.0).messages  # before the first odometry there is no time
    vessel.handle(Received("odometry", odometry(1), 0), 0.1)
    (taken,) = vessel.hear(text, 0.15).messages
    assert taken.made_here
    said = cdr.decode_sentence(taken.payload)
    assert (said.text, said.stamp_ns) == (text, START_NS + SCAN_NS)


def test_replayed_messages_give_the_same_decisions():
    config = RuntimeConfig(senses=SensesSettings(ais=AisSettings(datum=DATUM)))

    def messages(k):
        return [("nmea", p) for p in sentences(k, (50.0, 50.0 - 0.4 * k))] if k % 20 == 0 else []

    once, again = (decisions(sail(config, messages)[1]) for _ in range(2))
    assert [cdr.encode_decision(d) for d in once] == [cdr.encode_decision(d) for d in again]
    assert replace(once[-1]).tracks.id.tolist() == [0]

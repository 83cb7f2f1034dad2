"""What the loop tells ground stations, and how often."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from tests.harness.boat import Steady, cloud, make_pipeline, odometry, stamp

from twinscrew.runtime.bus.base import Inbox, Received
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.ground.report import FORGOTTEN_S, GroundReport, GroundSettings
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.link.transport import UdpTransport, open_transport
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Decision, Objects, Severity, Tracks
from twinscrew.runtime.safety.events import GOAL_SET
from twinscrew.runtime.vessel.outputs import Publisher
from twinscrew.runtime.vessel.realtime import Loop
from twinscrew.runtime.vessel.vessel import Vessel


def decision() -> Decision:
    """One object 10 m ahead, of 1 m radius."""
    objects = Objects(
        stamp_ns=0, p_L=np.array([[10.0, 0.0]]), radius=np.ones(1), points=np.array([30])
    )
    tracks = Tracks(
        stamp_ns=0,
        id=np.empty(0, np.int64),
        p_N=np.empty((0, 2)),
        v_N=np.empty((0, 2)),
        radius=np.empty(0),
        covariance=np.empty((0, 4, 4)),
        age_s=np.empty(0),
    )
    return Decision(
        stamp_ns=0,
        sequence=0,
        acted=False,
        thrust_rate=np.zeros(2),
        thrust=np.zeros(2),
        observation=None,
        objects=objects,
        tracks=tracks,
    )


def told(settings: GroundSettings, seconds: float) -> list:
    """Everything told in so many seconds at 20 Hz, with decisions at 10 Hz."""
    report = GroundReport(settings)
    messages = []
    for k in range(round(seconds * 20)):
        now_s = k * 0.05
        if k % 2 == 0:
            report.decided(decision(), 1.25, now_s)
        messages += report.due(now_s)
    return messages


def test_by_default_nothing_is_told() -> None:
    assert told(GroundSettings(), 2.0) == []


def test_obstacles_and_latency_are_told_as_often_as_is_asked_for() -> None:
    messages = told(GroundSettings(obstacles_hz=5.0, latency_hz=1.0), 4.0)
    kinds = [message.get_type() for message in messages]
    assert kinds.count("OBSTACLE_DISTANCE") == 20
    assert kinds.count("NAMED_VALUE_FLOAT") == 4
    assert {m.value for m in messages if m.get_type() == "NAMED_VALUE_FLOAT"} == {1.25}
    assert messages[0].distances[0] == 900


def test_before_the_first_decision_and_after_the_last_nothing_is_told() -> None:
    report = GroundReport(GroundSettings(obstacles_hz=5.0))
    assert report.due(0.0) == []
    report.decided(decision(), 1.0, 1.0)
    assert len(report.due(1.0)) == 1
    assert report.due(1.0 + FORGOTTEN_S + 0.01) == []


class Station:
    """Listens where the loop sends, on a real socket."""

    def __init__(self) -> None:
        self.listener = UdpTransport("127.0.0.1", 0, listens=True)
        self.boat = open_transport(f"udpout:127.0.0.1:{self.listener.port}")
        self.wire = Wire(255, 190)
        self.heard: dict[str, list] = {}

    def listen(self) -> None:
        for message in self.wire.decode(self.listener.receive()):
            self.heard.setdefault(message.get_type(), []).append(message)

    def close(self) -> None:
        self.boat.close()
        self.listener.close()


@pytest.fixture
def station() -> Iterator[Station]:
    station = Station()
    yield station
    station.close()


def test_the_loop_sends_what_is_due_with_its_commands(station) -> None:
    inbox = Inbox()
    report = GroundReport(GroundSettings(obstacles_hz=20.0, latency_hz=20.0), sees_m=20.0)
    link = AutopilotLink(AutopilotSettings())
    vessel = Vessel(make_pipeline(Steady()), link, report=report)
    loop = Loop(vessel, inbox, station.boat, Publisher(None, None), rate_hz=50.0)
    scans = iter(range(10_000))

    def sense_until_told() -> bool:
        time_s = next(scans) * 0.05
        for topic, payload in (
            ("odometry", cdr.encode_odometry(odometry(time_s))),
            ("points", cdr.encode_point_cloud(cloud(time_s))),
        ):
            inbox.put(Received(topic, payload, 0))
        station.listen()
        return {"NAMED_VALUE_FLOAT", "STATUSTEXT"} <= set(station.heard)

    loop.run(sense_until_told)
    assert {"HEARTBEAT", "OBSTACLE_DISTANCE", "NAMED_VALUE_FLOAT"} <= set(station.heard)
    obstacles = station.heard["OBSTACLE_DISTANCE"][0]
    assert set(obstacles.distances) == {2001}  # no farther than perception looks
    assert vessel.stamp_ns >= stamp(0.0)


def test_tracked_vessels_are_told_once_a_second_if_it_is_known_where_they_are() -> None:
    settings = GroundSettings(vessels_hz=1.0)
    for datum, count in ((Datum(latitude_deg=0.0, longitude_deg=0.0), 3), (None, 0)):
        report = GroundReport(settings, datum, 7)
        told = []
        for k in range(60):
            report.decided(replace(decision(), tracks=one_vessel()), 1.0, k * 0.05)
            told += report.due(k * 0.05)
        assert [message.get_type() for message in told] == ["AIS_VESSEL"] * count
        assert all(message.MMSI == 100_007_004 for message in told)


def one_vessel() -> Tracks:
    return Tracks(
        stamp_ns=0,
        id=np.array([4]),
        p_N=np.array([[10.0, 0.0]]),
        v_N=np.array([[0.0, 2.0]]),
        radius=np.ones(1),
        covariance=np.zeros((1, 4, 4)),
        age_s=np.zeros(1),
    )


def test_without_texts_nothing_is_said_but_what_was_refused() -> None:
    report = GroundReport(GroundSettings(texts=False))
    report.happened((GOAL_SET.at(0),), 0.0)
    report.complain(["goal refused: it is too far"])
    assert report.texts() == [("goal refused: it is too far", Severity.WARNING)]
    assert report.texts() == []

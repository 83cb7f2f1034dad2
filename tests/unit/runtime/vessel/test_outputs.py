"""What a vessel gives is published, recorded, counted and hashed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.harness.boat import Steady, decided, make_pipeline, odometry

from twinscrew.runtime.bus.base import MemoryBus, Received
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.messages.types import Decision, Tracks
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.recording.recording import DecisionHash
from twinscrew.runtime.safety.events import LIDAR_STALE, OVERRUN
from twinscrew.runtime.vessel.frames import Frames, FrameSettings
from twinscrew.runtime.vessel.outputs import (
    PATH_PLACES,
    Outputs,
    Publisher,
    SailedPath,
    Taken,
    situation_shapes,
)

OUTPUTS = ("decision", "objects", "tracks", "diagnostics", "thrust_left", "thrust_right")


class Book:
    """A recorder that keeps what it gets in a list, and loses what it is told to."""

    def __init__(self) -> None:
        self.pages: list[tuple[str, bytes, int]] = []
        self.dropped = 0
        self.failure: str | None = None

    def record(self, topic: str, payload: bytes, time_ns: int) -> None:
        self.pages.append((topic, payload, time_ns))


class BrokenBus:
    """A bus whose session is gone."""

    def publish(self, topic: str, payload: bytes) -> None:
        raise BusError("the bus is closed")


def decide() -> Decision:
    return decided(make_pipeline(Steady()), 0.0)


def outputs(thrust=(0.0, 0.0), **parts: object) -> Outputs:
    return Outputs(thrust=np.array(thrust), **parts)


def test_a_decision_is_published_with_what_it_was_made_of_and_the_thrust() -> None:
    bus, heard = MemoryBus("wamv"), {}
    for topic in OUTPUTS:
        bus.subscribe(topic, lambda message: heard.update({message.topic: message.payload}))
    decision = decide()
    Publisher(bus, None).publish(outputs((12.0, -3.0), decision=decision))
    assert set(heard) == set(OUTPUTS) - {"diagnostics"}
    assert heard["decision"] == cdr.encode_decision(decision)
    assert cdr.decode_thrust(heard["thrust_left"]) == 12.0
    assert cdr.decode_thrust(heard["thrust_right"]) == -3.0


def test_what_is_published_is_recorded_with_the_clocks_time() -> None:
    book = Book()
    publisher = Publisher(None, book, clock_ns=lambda: 7)
    publisher.publish(outputs(messages=[Taken("points", b"scan")], decision=decide()))
    assert book.pages[0] == ("points", b"scan", 7)
    assert [topic for topic, *_ in book.pages[1:]] == [
        "decision", "objects", "tracks", "detections", "situation", "thrust_left", "thrust_right"
    ]  # fmt: skip


def test_decisions_are_counted_and_hashed_even_where_nobody_is_told() -> None:
    publisher, expected = Publisher(None, None), DecisionHash()
    for _ in range(3):
        publisher.publish(outputs(decision=decide()))
        expected.add(cdr.encode_decision(decide()))
    assert (publisher.decisions, publisher.sha256) == (3, expected.hexdigest())


def test_events_are_told_together_with_the_newest_ones_time() -> None:
    bus, heard = MemoryBus("wamv"), []
    bus.subscribe("diagnostics", heard.append)
    publisher = Publisher(bus, None, vessel="wamv")
    publisher.report((LIDAR_STALE.at(5, "old"), OVERRUN.at(9)))
    publisher.report(())
    (message,) = heard
    assert isinstance(message, Received)
    assert [e.name for e in cdr.decode_diagnostics(message.payload)] == ["lidar_stale", "overrun"]


def test_a_broken_bus_stops_neither_the_loop_nor_the_recording() -> None:
    book = Book()
    publisher = Publisher(BrokenBus(), book)
    publisher.publish(outputs(decision=decide(), events=[OVERRUN.at(1)]))
    assert publisher.decisions == 1
    assert [topic for topic, *_ in book.pages][-1] == "diagnostics"


def test_a_recorders_losses_are_told_when_they_begin_and_when_they_have_doubled() -> None:
    book = Book()
    publisher = Publisher(None, book)
    told = []
    for dropped in (0, 0, 1, 1, 2, 3, 4, 7, 8):
        book.dropped = dropped
        told.append(publisher.recorder_trouble() is not None)
    assert told == [False, False, True, False, True, False, True, False, True]
    book.dropped, book.failure = 100, "the disk is full"
    assert publisher.recorder_trouble() == "100 messages lost: the disk is full"


@pytest.mark.parametrize("recorder", [None, Book()])
def test_a_recorder_that_loses_nothing_is_no_trouble(recorder: Book | None) -> None:
    assert Publisher(None, recorder).recorder_trouble() is None


class Leaky(MemoryBus):
    """A bus on which messages went missing."""

    def __init__(self) -> None:
        super().__init__("wamv")
        self.counts: dict[str, int] = {}

    @property
    def missing(self) -> dict[str, int]:
        return self.counts


def test_what_is_missing_of_the_bus_is_told_by_topic_when_it_begins_and_when_it_has_doubled() -> (
    None
):
    bus = Leaky()
    publisher = Publisher(bus, None)
    assert publisher.bus_trouble() is None
    bus.counts = {"points too large": 1}
    assert publisher.bus_trouble() == "1 points too large"
    assert publisher.bus_trouble() is None
    bus.counts["odometry lost"] = 2
    assert publisher.bus_trouble() == "1 points too large, 2 odometry lost"


def test_without_a_bus_nothing_is_missing_on_it() -> None:
    assert Publisher(None, None).bus_trouble() is None


def test_the_state_is_told_once_a_second_for_those_who_come_late() -> None:
    book, times_ns = Book(), iter(np.arange(0, 3_000_000_000, 50_000_000).tolist())
    now = [0]
    publisher = Publisher(None, book, clock_ns=lambda: now[0])
    for now[0] in times_ns:
        publisher.state("ready" if now[0] < 1_500_000_000 else "active", 7)
    told = [cdr.decode_diagnostics(payload)[0] for _, payload, _ in book.pages]
    assert [(event.name, event.detail) for event in told] == [
        ("state_now", "ready"), ("state_now", "ready"), ("state_now", "active")
    ]  # fmt: skip


def test_the_way_that_was_sailed_is_published() -> None:
    bus, heard = MemoryBus("wamv"), []
    bus.subscribe("path", lambda message: heard.append(message.payload))
    publisher = Publisher(bus, None)
    for k in range(41):
        message = odometry(0.05 * k, north=0.1 * k)
        publisher.publish(Outputs(messages=[Taken("odometry", b"", message)]))
    assert len(heard) == 3
    np.testing.assert_allclose(cdr.decode_path(heard[-1])[1][-1], (4.0, 0.0), atol=0.11)


def sail(path, times_s, speed=2.0):
    """Go north; give what was told."""
    paths = (path.step(odometry(t, north=speed * t)) for t in times_s)
    return [encoded for encoded in paths if encoded is not None]


def test_it_is_told_once_a_second_with_a_place_a_metre():
    told = sail(SailedPath(), np.arange(0.0, 10.0, 0.05))
    assert len(told) == 10
    _, places_N, _ = cdr.decode_path(told[-1])
    np.testing.assert_allclose(np.diff(places_N[:, 0]), 1.0, atol=0.11)
    assert (places_N[:, 1] == 0.0).all()


def test_a_boat_at_rest_leaves_one_place():
    told = sail(SailedPath(), np.arange(0.0, 5.0, 0.05), speed=0.0)
    assert len(cdr.decode_path(told[-1])[1]) == 1


def test_a_long_way_keeps_its_end():
    told = sail(SailedPath(), np.arange(0.0, 2.0 * PATH_PLACES, 1.0))
    _, places_N, _ = cdr.decode_path(told[-1])
    assert len(places_N) == PATH_PLACES
    assert places_N[-1, 0] == 2.0 * (2.0 * PATH_PLACES - 1)


def test_a_clock_set_back_does_not_silence_it():
    path = SailedPath()
    sail(path, [100.0])
    assert len(sail(path, [10.0, 10.5, 11.1])) == 2


def test_only_what_was_made_here_is_published_and_all_of_it_is_recorded() -> None:
    bus, heard, book = MemoryBus("wamv"), [], Book()
    for topic in ("odometry", "points"):
        bus.subscribe(topic, heard.append)
    taken = [Taken("points", b"scan"), Taken("odometry", b"own", made_here=True)]
    Publisher(bus, book, clock_ns=lambda: 7).publish(Outputs(messages=taken))
    assert [message.payload for message in heard] == [b"own"]
    assert book.pages == [("points", b"scan", 7), ("odometry", b"own", 7)]


@pytest.mark.parametrize("publish", [False, True])
def test_transforms_are_always_recorded_and_published_where_the_settings_say_so(
    publish: bool,
) -> None:
    bus, heard, book = MemoryBus("wamv"), [], Book()
    for topic in ("transforms", "static_transforms"):
        bus.subscribe(topic, heard.append)
    frames = Frames(FrameSettings(publish=publish), "wamv", load_sensor("vrx16"))
    frames.see("wamv/lidar")
    publisher = Publisher(bus, book, frames=frames, clock_ns=lambda: 7)
    for k in range(3):
        made = odometry(k / 2)
        publisher.publish(Outputs(messages=[Taken("odometry", cdr.encode_odometry(made), made)]))
    recorded = [topic for topic, _, _ in book.pages]
    assert recorded.count("transforms") == 3
    assert recorded.count("static_transforms") == 2  # once a second
    assert [m.topic for m in heard].count("transforms") == (3 if publish else 0)
    assert [m.topic for m in heard].count("static_transforms") == (2 if publish else 0)


def test_markers_and_path_are_in_the_frames_of_the_odometry() -> None:
    book, frames = Book(), Frames(None, "wamv")
    frames.follow(replace(odometry(0.0), frame_id="map", child_frame_id="wamv/base_link"))
    publisher = Publisher(None, book, frames=frames, clock_ns=lambda: 7)
    made = odometry(0.0)
    publisher.publish(Outputs(messages=[Taken("odometry", cdr.encode_odometry(made), made)]))
    publisher.publish(outputs((12.0, -3.0), decision=decide()))
    named = {}
    for topic, payload, _ in book.pages:
        if topic in ("path", "objects", "tracks"):
            message = type_store().deserialize_cdr(payload, TOPICS[topic].ros_type)
            named[topic] = (message.markers[0] if topic != "path" else message).header.frame_id
    assert named == {"path": "map", "objects": "wamv/base_link", "tracks": "map"}


def test_goals_buoys_and_the_zones_of_vessels_under_way_are_drawn_twice_a_second() -> None:
    tracks = Tracks(
        stamp_ns=0,
        id=np.array([7, 8, 9]),
        p_N=np.array([[10.0, 0.0], [20.0, 5.0], [40.0, 0.0]]),
        v_N=np.array([[0.1, 0.0], [0.0, 2.0], [0.0, 0.0]]),  # a buoy, a vessel going east, a quay
        radius=np.array([0.5, 2.5, 15.0]),
        covariance=np.zeros((3, 4, 4)),
        age_s=np.zeros(3),
    )
    goals_N = np.array([[50.0, 0.0], [60.0, 10.0]])
    drawn = {(s.namespace, s.number): s for s in situation_shapes(tracks, goals_N)}
    assert set(drawn) == {
        ("goals", 0), ("goals", 1), ("buoys", 7), ("head_on", 8), ("crossing", 8)
    }  # fmt: skip
    ahead = drawn["head_on", 8].points_N - (20.0, 5.0)
    assert ahead[:, 1].max() == pytest.approx(17.0)  # along its velocity: east
    to_port = drawn["crossing", 8].points_N - (20.0, 5.0)
    assert to_port[:, 0].max() == pytest.approx(17.0)  # of a vessel going east: north
    book = Book()
    publisher = Publisher(None, book, clock_ns=lambda: 7)
    for k in range(11):
        made = replace(decide(), tracks=replace(tracks, stamp_ns=k * 100_000_000))
        publisher.publish(outputs(decision=made, goals_N=goals_N))
    assert [topic for topic, *_ in book.pages].count("situation") == 3


def test_the_chart_is_published_again_for_who_comes_late_and_recorded_once() -> None:
    bus, heard, book, now = MemoryBus("wamv"), [], Book(), [0]
    bus.subscribe("chart", heard.append)
    publisher = Publisher(bus, book, clock_ns=lambda: now[0])
    publisher.publish(outputs(messages=[Taken("chart", b"a map", made_here=True)]))
    for second in range(1, 13):
        now[0] = second * 1_000_000_000
        publisher.state("READY", now[0])
    assert [message.payload for message in heard] == [b"a map"] * 3
    assert [topic for topic, *_ in book.pages].count("chart") == 1

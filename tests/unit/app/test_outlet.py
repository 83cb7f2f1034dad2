import numpy as np
import pytest
from tests.harness.boat import Steady, cloud, make_pipeline, odometry

from twinscrew.runtime.app.outlet import Outlet
from twinscrew.runtime.app.recording import DecisionHash
from twinscrew.runtime.bus.base import MemoryBus, Received
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Decision
from twinscrew.runtime.safety.events import LIDAR_STALE, OVERRUN

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
    return make_pipeline(Steady()).step(cloud(0.0), odometry(0.0), engaged=True)


def test_a_decision_is_published_with_what_it_was_made_of_and_the_thrust() -> None:
    bus, heard = MemoryBus("wamv"), {}
    for topic in OUTPUTS:
        bus.subscribe(topic, lambda message: heard.update({message.topic: message.payload}))
    decision = decide()
    Outlet(bus, None).decided(decision, np.array([12.0, -3.0]))
    assert set(heard) == set(OUTPUTS) - {"diagnostics"}
    assert heard["decision"] == cdr.encode_decision(decision)
    assert cdr.decode_thrust(heard["thrust_left"]) == 12.0
    assert cdr.decode_thrust(heard["thrust_right"]) == -3.0


def test_what_is_published_is_recorded_with_the_clocks_time() -> None:
    book = Book()
    outlet = Outlet(None, book, clock_ns=lambda: 7)
    outlet.record("points", b"scan")
    outlet.decided(decide(), np.zeros(2))
    assert book.pages[0] == ("points", b"scan", 7)
    assert [topic for topic, *_ in book.pages[1:]] == [
        "decision", "objects", "tracks", "thrust_left", "thrust_right"
    ]  # fmt: skip


def test_decisions_are_counted_and_hashed_even_where_nobody_is_told() -> None:
    outlet, expected = Outlet(None, None), DecisionHash()
    for _ in range(3):
        outlet.decided(decide(), np.zeros(2))
        expected.add(cdr.encode_decision(decide()))
    assert (outlet.decisions, outlet.sha256) == (3, expected.hexdigest())


def test_events_are_told_together_with_the_newest_ones_time() -> None:
    bus, heard = MemoryBus("wamv"), []
    bus.subscribe("diagnostics", heard.append)
    outlet = Outlet(bus, None, vessel="wamv")
    outlet.happened((LIDAR_STALE.at(5, "old"), OVERRUN.at(9)))
    outlet.happened(())
    (message,) = heard
    assert isinstance(message, Received)
    assert [e.name for e in cdr.decode_diagnostics(message.payload)] == ["lidar_stale", "overrun"]


def test_a_broken_bus_stops_neither_the_loop_nor_the_recording() -> None:
    book = Book()
    outlet = Outlet(BrokenBus(), book)
    outlet.decided(decide(), np.zeros(2))
    outlet.happened((OVERRUN.at(1),))
    assert outlet.decisions == 1
    assert [topic for topic, *_ in book.pages][-1] == "diagnostics"


def test_a_recorders_losses_are_told_when_they_begin_and_when_they_have_doubled() -> None:
    book = Book()
    outlet = Outlet(None, book)
    told = []
    for dropped in (0, 0, 1, 1, 2, 3, 4, 7, 8):
        book.dropped = dropped
        told.append(outlet.recorder_trouble() is not None)
    assert told == [False, False, True, False, True, False, True, False, True]
    book.dropped, book.failure = 100, "the disk is full"
    assert outlet.recorder_trouble() == "100 messages lost: the disk is full"


@pytest.mark.parametrize("recorder", [None, Book()])
def test_a_recorder_that_loses_nothing_is_no_trouble(recorder: Book | None) -> None:
    assert Outlet(None, recorder).recorder_trouble() is None


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
    outlet = Outlet(bus, None)
    assert outlet.bus_trouble() is None
    bus.counts = {"points too large": 1}
    assert outlet.bus_trouble() == "1 points too large"
    assert outlet.bus_trouble() is None
    bus.counts["odometry lost"] = 2
    assert outlet.bus_trouble() == "1 points too large, 2 odometry lost"


def test_without_a_bus_nothing_is_missing_on_it() -> None:
    assert Outlet(None, None).bus_trouble() is None


def test_the_state_is_told_once_a_second_for_those_who_come_late() -> None:
    book, times_ns = Book(), iter(np.arange(0, 3_000_000_000, 50_000_000).tolist())
    now = [0]
    outlet = Outlet(None, book, clock_ns=lambda: now[0])
    for now[0] in times_ns:
        outlet.state("ready" if now[0] < 1_500_000_000 else "active", 7)
    told = [cdr.decode_diagnostics(payload)[0] for _, payload, _ in book.pages]
    assert [(event.name, event.detail) for event in told] == [
        ("state_now", "ready"), ("state_now", "ready"), ("state_now", "active")
    ]  # fmt: skip


def test_the_way_that_was_sailed_is_published() -> None:
    bus, heard = MemoryBus("wamv"), []
    bus.subscribe("path", lambda message: heard.append(message.payload))
    outlet = Outlet(bus, None)
    for k in range(41):
        outlet.record("odometry", cdr.encode_odometry(odometry(0.05 * k, north=0.1 * k)))
    assert len(heard) == 3
    np.testing.assert_allclose(cdr.decode_path(heard[-1])[1][-1], (4.0, 0.0), atol=0.11)


def test_nobody_is_told_of_the_way_if_nobody_listens() -> None:
    outlet = Outlet(None, None)
    outlet.record("odometry", b"not even read")

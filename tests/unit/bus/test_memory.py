import pytest

from twinscrew.runtime.bus.base import MemoryBus
from twinscrew.runtime.errors import BusError


def test_a_message_arrives_before_publish_returns():
    bus, heard = MemoryBus("wamv1"), []
    bus.subscribe("goal", heard.append)
    bus.publish("goal", b"a")
    assert [(m.topic, m.payload, m.received_ns) for m in heard] == [("goal", b"a", 0)]


def test_what_a_receiver_publishes_waits_until_everybody_has_heard_the_first():
    bus, order = MemoryBus("wamv1"), []
    bus.subscribe("points", lambda m: bus.publish("decision", b"d"))
    bus.subscribe("decision", lambda m: order.append("decision"))
    bus.subscribe("points", lambda m: order.append("points"))
    bus.publish("points", b"p")
    assert order == ["points", "decision"]


def test_vessels_do_not_hear_each_other():
    simulator = MemoryBus("wamv1")
    heard = {"wamv1": [], "wamv2": []}
    for vessel, messages in heard.items():
        simulator.within(vessel).subscribe("odometry", messages.append)
    simulator.within("wamv2").publish("odometry", b"2")
    simulator.publish("odometry", b"1")
    assert [m.payload for m in heard["wamv1"]] == [b"1"]
    assert [m.payload for m in heard["wamv2"]] == [b"2"]


def test_the_clock_is_heard_by_all_vessels():
    simulator, heard = MemoryBus("wamv1"), []
    simulator.within("wamv2").subscribe("clock", heard.append)
    simulator.publish("clock", b"c")
    assert len(heard) == 1


def test_a_receiver_that_raises_does_not_jam_the_bus():
    bus, heard = MemoryBus("wamv1"), []

    def fail_once(message):
        if message.payload == b"1":
            raise ValueError("once")
        heard.append(message.payload)

    bus.subscribe("goal", fail_once)
    with pytest.raises(ValueError, match="once"):
        bus.publish("goal", b"1")
    bus.publish("goal", b"2")
    assert heard == [b"2"]


def test_a_closed_bus_says_so():
    bus = MemoryBus("wamv1")
    bus.close()
    bus.close()
    with pytest.raises(BusError, match="closed"):
        bus.within("wamv2").publish("goal", b"")


def test_a_topic_outside_the_table_is_refused_with_the_table():
    with pytest.raises(BusError, match="'lidar' is not one of 'points', 'odometry'"):
        MemoryBus("wamv1").subscribe("lidar", print)

import threading

import pytest

from twinscrew.runtime.bus.base import Inbox, MemoryBus, Received
from twinscrew.runtime.messages.topics import TOPICS


def put(inbox, *messages):
    for topic, payload in messages:
        inbox.put(Received(topic, payload, 0))


def contents(messages):
    return [(m.topic, m.payload) for m in messages]


def test_messages_come_out_in_the_order_in_which_they_came_in():
    inbox = Inbox()
    put(inbox, ("odometry", b"1"), ("points", b"2"), ("odometry", b"3"), ("goal", b"4"))
    order = [("odometry", b"1"), ("points", b"2"), ("odometry", b"3"), ("goal", b"4")]
    assert contents(inbox.wait(0)) == order
    assert inbox.wait(0) == []


def test_of_the_scans_only_the_newest_is_kept_in_the_place_where_it_came():
    inbox = Inbox()
    put(inbox, ("points", b"old"), ("odometry", b"1"), ("points", b"new"))
    assert contents(inbox.wait(0)) == [("odometry", b"1"), ("points", b"new")]
    assert inbox.passed_over == {"points": 1}


def test_a_loop_that_never_looks_fills_no_memory():
    inbox = Inbox()
    depth = TOPICS["odometry"].depth
    put(inbox, *(("odometry", b"%d" % i) for i in range(10 * depth)))
    kept = inbox.wait(0)
    assert len(kept) == depth
    assert kept[-1].payload == b"%d" % (10 * depth - 1)
    assert inbox.passed_over == {"odometry": 9 * depth}


@pytest.mark.parametrize("topic", ["goal", "route"])
def test_of_the_orders_that_come_at_once_only_the_newest_is_worked_on(topic):
    inbox = Inbox()
    put(inbox, *((topic, b"%d" % i) for i in range(1000)))
    assert contents(inbox.wait(0)) == [(topic, b"999")]


def test_a_goal_and_a_route_that_come_at_once_come_out_as_they_came_in():
    inbox = Inbox()
    put(inbox, ("route", b"1"), ("goal", b"2"), ("route", b"3"))
    assert contents(inbox.wait(0)) == [("goal", b"2"), ("route", b"3")]


def test_what_was_read_does_not_count_as_unread():
    inbox = Inbox()
    for i in range(5):
        put(inbox, ("points", b"%d" % i))
        assert contents(inbox.wait(0)) == [("points", b"%d" % i)]
    assert inbox.passed_over == {}


def test_a_message_from_another_thread_ends_the_wait():
    inbox = Inbox()
    waiting = threading.Event()

    def send():
        waiting.wait()
        put(inbox, ("goal", b"go"))

    sender = threading.Thread(target=send)
    sender.start()
    waiting.set()
    assert contents(inbox.wait(60)) == [("goal", b"go")]
    sender.join()


def test_nothing_by_the_deadline_is_an_empty_list():
    assert Inbox().wait(0.001) == []


def test_it_listens_to_the_topics_of_a_bus():
    bus, inbox = MemoryBus("wamv1"), Inbox()
    inbox.listen(bus, ("points", "goal"))
    for topic in ("points", "odometry", "goal"):
        bus.publish(topic, b"x")
    assert [m.topic for m in inbox.wait(0)] == ["points", "goal"]

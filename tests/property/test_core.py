"""Whatever comes in, in whatever order: no exception, no thrust out of range, and it recovers."""

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.boat import Boat, cloud, feed, make_pipeline, odometry, stamp
from tests.harness.work import examples

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.bus.base import MemoryBus
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import CORE_INPUTS
from twinscrew.runtime.messages.types import Decision, Engagement, Goal
from twinscrew.runtime.policy.load import Policy, load_policy
from twinscrew.runtime.vessel.health import State
from twinscrew.runtime.vessel.outputs import Publisher
from twinscrew.runtime.vessel.vessel import Vessel


@functools.cache
def real_scan() -> bytes:
    """A scan in which something is in sight: a tenth of the simulator's, for speed."""
    world = make_world(load_scenario("passage"), sensor="vrx16")
    seen = world.cloud(0)
    return cdr.encode_point_cloud(cloud(1.0, seen.points_S[::10]))


def good(topic: str, time_s: float = 1.0) -> bytes:
    if topic == "points":
        return real_scan()
    if topic == "odometry":
        return cdr.encode_odometry(odometry(time_s))
    if topic == "goal":
        return cdr.encode_goal(Goal(stamp_ns=stamp(time_s), position_N=np.array([30.0, 5.0])))
    return cdr.encode_engagement(Engagement(stamp_ns=stamp(time_s), engaged=True))


TOPICS = st.sampled_from(CORE_INPUTS)


@st.composite
def damaged(draw: st.DrawFn) -> tuple[str, bytes]:
    """A real message with bits turned, words overwritten, or its end missing."""
    topic = draw(TOPICS)
    payload = bytearray(good(topic, draw(st.floats(0.0, 3.0))))
    head = min(len(payload), 400)  # where sizes, stamps and names are
    for _ in range(draw(st.integers(0, 4))):
        place = draw(st.integers(0, head - 1))
        payload[place] ^= 1 << draw(st.integers(0, 7))
    if draw(st.booleans()):
        place = draw(st.integers(0, head - 1)) // 8 * 8 + 4
        number = np.float64(draw(st.floats(width=64))).tobytes()
        payload[place : place + 8] = number
    if draw(st.booleans()):
        del payload[draw(st.integers(0, len(payload))) :]
    return topic, bytes(payload)


PLACES = st.one_of(st.floats(-20.0, 20.0), st.floats(-1e8, 1e8), st.floats(-1e300, 1e300))
NOISE = st.tuples(TOPICS, st.binary(max_size=200))
MOVING = st.builds(
    lambda time_s, north, east: ("odometry", cdr.encode_odometry(odometry(time_s, north, east))),
    st.floats(-10.0, 10.0),
    PLACES,
    PLACES,
)
SEEING = st.builds(
    lambda time_s, points: ("points", cdr.encode_point_cloud(cloud(time_s, points))),
    st.floats(-10.0, 10.0),
    st.lists(st.tuples(*[st.floats(width=32)] * 3), max_size=20),
)
HEADING = st.builds(
    lambda north, east: (
        "goal",
        cdr.encode_goal(Goal(stamp_ns=stamp(0.0), position_N=np.array([north, east]))),
    ),
    PLACES,
    PLACES,
)
STORIES = st.lists(st.one_of(damaged(), NOISE, MOVING, SEEING, HEADING), max_size=25)


@functools.cache
def policy() -> Policy:
    return load_policy("ac_iqn")


def check(decision: Decision) -> None:
    assert np.isfinite(decision.thrust).all()
    assert (decision.thrust >= -500.0).all()
    assert (decision.thrust <= 1000.0).all()


@pytest.mark.slow
@settings(max_examples=examples(200), deadline=None)
@given(story=STORIES)
def test_the_core_never_raises_and_its_thrust_is_always_one_that_propellers_can_give(
    story: list[tuple[str, bytes]],
) -> None:
    vessel = Vessel(make_pipeline(policy()), AutopilotLink(AutopilotSettings()))
    publisher = Publisher(MemoryBus("wamv"), None)
    feed(vessel, "engagement", good("engagement"))
    for topic, payload in story:
        out = feed(vessel, topic, payload)
        publisher.publish(out)
        assert not [e.detail for e in out.events if e.name == "internal_error"]
        if out.decision is not None:
            check(out.decision)


@pytest.mark.slow
@settings(max_examples=examples(25), deadline=None)
@given(story=STORIES, seconds=st.floats(0.5, 3.0))
def test_a_boat_stays_within_its_limits_and_sails_on_after_any_rubbish(
    story: list[tuple[str, bytes]], seconds: float
) -> None:
    boat = Boat().sail(seconds)
    for topic, payload in story:
        boat.take_in(topic, payload)
        assert np.isfinite(boat.thrust).all()
    boat.take_in("engagement", cdr.encode_engagement(Engagement(stamp_ns=0, engaged=True)))
    boat.take_in("goal", cdr.encode_goal(Goal(stamp_ns=0, position_N=np.array([500.0, 0.0]))))
    boat.sail(4.0)
    assert boat.vessel.state is State.ACTIVE
    assert boat.moves


@pytest.mark.slow
@settings(max_examples=examples(15), deadline=None)
@given(data=st.data())
def test_a_line_that_damages_loses_and_repeats_never_stops_the_loop(data: st.DataObject) -> None:
    generator = data.draw(st.randoms(use_true_random=False))

    def line(topic: str, payload: bytes) -> list[bytes]:
        fate = generator.random()
        if fate < 0.2:
            return []
        if fate < 0.4:
            return [payload, payload]
        if fate < 0.6:
            spoilt = bytearray(payload)
            spoilt[generator.randrange(len(spoilt))] ^= 1 << generator.randrange(8)
            return [bytes(spoilt)]
        return [payload]

    boat = Boat().sail(2.0)
    boat.line = line
    boat.sail(3.0)
    assert all(np.isfinite(thrust).all() for _, thrust in boat.thrusts)
    boat.line = lambda topic, payload: (payload,)
    boat.sail(4.0)
    assert boat.vessel.state is State.ACTIVE
    assert boat.moves

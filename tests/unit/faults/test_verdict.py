"""A promise is broken by each thing that breaks it, and by nothing else."""

import numpy as np
import pytest

from twinscrew.hil_sim.faults.crew import Made
from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.hil_sim.faults.plan import Fault, Promise
from twinscrew.hil_sim.faults.timeline import Timeline
from twinscrew.hil_sim.faults.verdict import Verdict, judge
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.runtime.safety.events import LIDAR_STALE, OVERRIDE_IGNORED, STATE

BEGIN_S, END_S, NOW_S = 5.0, 7.0, 11.0
STOPS = ((0.0, True), (5.4, False), (7.5, True))
NEVER = ((0.0, True),)
AHEAD = ((0.0, (1, 1)),)
MANUAL = Bridge("MANUAL", armed=True)
TOLD = ((5.4, LIDAR_STALE.at(0)), (5.4, STATE.at(0, "active -> safe")))
MADE = [Made(0, Fault(at_s=5.0, for_s=2.0, kind="drop", target="points"), BEGIN_S, END_S)]


def act(at_s: float, does: str) -> Made:
    fault = Fault(at_s=at_s, kind="pilot", target="autopilot", parameters={"does": does})
    return Made(0, fault, at_s, at_s + 0.01)


def verdict(
    turns=STOPS, *, made=MADE, told=TOLD, asks=AHEAD, log="", free_way=True, **promise
) -> Verdict:
    witness = Witness()
    witness.turns, witness.asks = Timeline(False, *turns), Timeline((0, 0), *asks)
    witness.events, witness.bridge = list(told), Timeline(MANUAL)
    states = [(t, event.detail.split()[-1]) for t, event in told if event.name == "state"]
    witness.state = Timeline("active", *states)
    promised = Promise(fault="x", reaction="y", **promise)
    return judge("mine", promised, made, witness, now_s=NOW_S, log=log, free_way=free_way)


def measured(found: Verdict) -> list[str]:
    return [row.measured for row in found.rows]


@pytest.mark.parametrize(
    ("promise", "words"),
    [
        ({"neutral_s": 0.5}, "0.40 s"),
        ({"event": "lidar_stale", "event_s": 0.5}, "0.40 s"),
        ({"state": "safe"}, "safe"),
        ({"moves_again_s": 1.0}, "0.50 s"),
        ({"mode": "MANUAL"}, "MANUAL"),
        ({"armed": True}, "armed"),
    ],
)
def test_a_promise_that_was_kept_is_measured(promise, words: str) -> None:
    found = verdict(**promise)
    assert found.kept
    assert words in measured(found)[0]
    assert found.as_dict()["kept"] is True


@pytest.mark.parametrize(
    ("promise", "words"),
    [
        ({"neutral_s": 0.3}, "0.40 s"),
        ({"neutral_s": 0.5, "turns": NEVER}, "never"),
        ({"neutral_s": 0.5, "turns": ((0.0, True), (5.4, False), (6.5, True))}, "never"),
        ({"neutral_s": 0.5, "turns": ((0.0, False),)}, "never turned"),
        ({"event": "lidar_stale", "event_s": 0.3}, "0.40 s"),
        ({"event": "odometry_stale"}, "never"),
        ({"state": "ready"}, "safe"),
        ({"moves_again_s": 0.4}, "0.50 s"),
        ({"moves_again_s": 9.0, "turns": STOPS[:2]}, "never"),
        ({"sails_on": True}, "stopped after 0.40 s"),
        ({"mode": "HOLD"}, "MANUAL"),
        ({"armed": False}, "armed"),
        ({"log": "Traceback (most recent call last):"}, "some"),
        ({"log": "thread 'tokio' panicked at"}, "some"),
    ],
)
def test_a_promise_that_was_broken_is_named(promise, words: str) -> None:
    found = verdict(**promise)
    assert not found.kept
    (broken,) = [row for row in found.rows if not row.kept]
    assert words in broken.measured


CHOSEN = ((0.0, (1, 1)), (5.4, (0, 0)), (7.4, (1, 1)))
"""What is asked for where the boat stops as in `STOPS` because it decided so."""


def test_steady_counts_the_stops_after_it_turns_again_that_the_boat_did_not_decide() -> None:
    before = ((0.0, True), (6.0, False), (7.5, True))
    assert verdict(before, moves_again_s=1.0, steady=True).kept
    pulsing = (*before, (9.0, False), (9.5, True), (10.0, False), (10.5, True))
    found = verdict(pulsing, moves_again_s=1.0, steady=True)
    assert "2 stops" in measured(found)
    assert not found.kept
    safe = ((9.0, STATE.at(0, "active -> safe")),)
    assert not verdict(pulsing, told=safe, asks=CHOSEN, moves_again_s=1.0, steady=True).kept


def test_a_vessel_that_sails_on_may_decide_to_rest_for_a_moment_but_not_be_safe() -> None:
    moment = ((0.0, True), (5.4, False), (6.0, True))
    assert verdict(moment, told=(), asks=CHOSEN, sails_on=True).kept
    assert not verdict(moment, told=(), sails_on=True).kept
    assert measured(verdict(NEVER, sails_on=True))[0] == "safe"


def test_a_vessel_with_something_in_its_way_may_decide_to_rest_for_long() -> None:
    assert not verdict(told=(), asks=CHOSEN, sails_on=True).kept
    assert verdict(told=(), asks=CHOSEN, sails_on=True, free_way=False).kept
    assert not verdict(told=(), sails_on=True, free_way=False).kept


IGNORED = {"event": "override_ignored", "event_s": 1.0, "event_from": "thrust"}
NAMED = ((6.5, OVERRIDE_IGNORED.at(0)),)


@pytest.mark.parametrize(
    ("asks", "told", "words"),
    [
        (AHEAD, NAMED, "1.50 s"),
        (AHEAD, (), "never"),
        (((0.0, (0, 1)), (6.2, (-1, 1))), NAMED, "1.50 s"),
    ],
)
def test_a_thrust_that_nobody_follows_must_be_named_in_time(asks, told, words: str) -> None:
    found = verdict(asks=asks, told=told, **IGNORED)
    assert not found.kept
    assert measured(found)[0] == words


@pytest.mark.parametrize(
    ("asks", "told", "words"),
    [
        (((0.0, (1, 1)), (5.8, (-1, -1))), NAMED, "0.80 s"),
        (((0.0, (0, 0)), (6.0, (1, 0))), NAMED, "0.50 s"),
        (((0.0, (0, 0)),), (), "no thrust to follow"),
    ],
)
def test_nothing_can_be_named_before_there_is_a_thrust_to_follow(asks, told, words: str) -> None:
    found = verdict(asks=asks, told=told, **IGNORED)
    assert found.kept
    assert measured(found)[0] == words


def test_a_vessel_that_rests_does_not_turn_until_the_end() -> None:
    made = [act(5.0, "hold")]
    assert verdict(STOPS[:2], made=made, rests=True, neutral_s=0.5).kept
    assert not verdict(STOPS, made=made, rests=True).kept


def test_a_vessel_that_waits_for_somebody_is_neutral_until_he_acts() -> None:
    made = [*MADE, act(9.0, "arm")]
    waits = ((0.0, True), (5.4, False), (9.2, True))
    assert verdict(waits, made=made, neutral_s=0.5, moves_again_s=1.0).kept
    assert not verdict(STOPS, made=made, neutral_s=0.5).kept


def test_nothing_promised_is_nothing_broken_but_by_an_exception() -> None:
    found = verdict()
    assert [row.what for row in found.rows] == ["unhandled exceptions"]
    assert np.all([row.kept for row in found.rows])


def test_propellers_may_have_to_rest_until_the_last_fault_is_over() -> None:
    longer = Fault(at_s=5.2, for_s=3.0, kind="drop", target="odometry")
    made = [*MADE, Made(0, longer, BEGIN_S + 0.2, END_S + 1.0)]
    turns_between = ((0.0, True), (5.4, False), (END_S + 0.5, True), (END_S + 0.8, False))
    assert verdict(turns_between, made=made, neutral_s=0.5).kept
    assert not verdict(turns_between, made=made, neutral_s=0.5, neutral_until="last").kept
    assert verdict(STOPS[:2], made=made, neutral_s=0.5, neutral_until="last").kept

"""A promise is broken by each thing that breaks it, and by nothing else."""

import numpy as np
import pytest

from twinscrew.hil_sim.faults.crew import Made
from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.hil_sim.faults.plan import Fault, Promise
from twinscrew.hil_sim.faults.verdict import Verdict, judge
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.runtime.safety.events import LIDAR_STALE, STATE

BEGIN_S, END_S, NOW_S = 5.0, 7.0, 11.0
STOPS = ((0.0, True), (5.4, False), (7.5, True))
NEVER = ((0.0, True),)
MANUAL = Bridge("MANUAL", armed=True)
TOLD = ((5.4, LIDAR_STALE.at(0)), (5.4, STATE.at(0, "active -> safe")))
MADE = [Made(0, Fault(at_s=5.0, for_s=2.0, kind="drop", target="points"), BEGIN_S, END_S)]


def act(at_s: float, does: str) -> Made:
    fault = Fault(at_s=at_s, kind="pilot", target="autopilot", parameters={"does": does})
    return Made(0, fault, at_s, at_s + 0.01)


def verdict(turns=STOPS, *, made=MADE, told=TOLD, log="", **promise):
    witness = Witness()
    witness.turns, witness.events, witness.bridge = list(turns), list(told), MANUAL
    promised = Promise(fault="x", reaction="y", **promise)
    return judge("mine", promised, made, witness, now_s=NOW_S, log=log)


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


def test_a_vessel_that_sails_on_may_rest_for_a_moment_but_not_be_safe() -> None:
    moment = ((0.0, True), (5.4, False), (6.0, True))
    assert verdict(moment, told=(), sails_on=True).kept
    assert not verdict(STOPS, told=(), sails_on=True).kept
    assert measured(verdict(moment, sails_on=True))[0] == "safe"


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

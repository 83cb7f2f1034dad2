import numpy as np
import pytest
from tests.unit.messages.test_decision import decision

from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.hil_sim.faults.timeline import Timeline
from twinscrew.hil_sim.faults.witness import Witness, directions
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.safety.events import LIDAR_STALE, STATE, STATE_NOW

MANUAL = Bridge("MANUAL", armed=True)


class Clock:
    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def saw(*turning: tuple[float, bool]) -> Witness:
    clock = Clock()
    witness = Witness(clock)
    for clock.now_s, turns in turning:
        witness.look(np.array([100.0, 0.0]) if turns else np.zeros(2), MANUAL, 1.0)
    return witness


def drives(
    *asks: tuple[float, tuple[int, int]], turns: Timeline[bool], state: str = "active"
) -> Witness:
    """Make a witness of a boat that is in one state all the time."""
    witness = Witness()
    witness.turns, witness.asks = turns, Timeline((0, 0), *asks)
    witness.state, witness.bridge = Timeline(state), Timeline(MANUAL)
    return witness


def test_rests_are_cut_off_where_one_looks_no_more() -> None:
    witness = saw((0.0, True), (5.3, False), (5.4, True), (5.6, False), (8.0, True))
    assert witness.rests(5.0, 7.0) == [(5.3, 5.4), (5.6, 7.0)]
    assert witness.rests(6.0, 7.0) == [(6.0, 7.0)]
    assert witness.rests(0.0, 5.0) == []


def test_one_propeller_is_enough_to_turn() -> None:
    witness = saw((0.0, False), (1.0, True))
    assert not witness.turning(0.5)
    assert witness.turning(1.5)
    assert witness.sails_from(0.5) == 1.0
    assert witness.sails_from(1.5) == 1.5
    assert saw((0.0, False)).sails_from(0.0) is None


def test_a_vessel_is_under_way_when_it_moves_by_its_propellers() -> None:
    clock = Clock()
    witness = Witness(clock)
    for clock.now_s, thrust_N, speed_m_s in ((1.0, 9.0, 0.4), (2.0, 9.0, 0.6), (3.0, 0.0, 0.6)):
        witness.look(np.array([thrust_N, 0.0]), MANUAL, speed_m_s)
    assert [witness.under_way(at_s) for at_s in (1.5, 2.5, 3.5)] == [False, True, False]


def test_a_rest_that_the_boat_decided_is_no_stop() -> None:
    rest = Timeline(True, (5.0, False), (8.0, True))
    asks = ((0.0, (1, 1)), (5.0, (0, 0)), (7.0, (-1, 0)))
    assert drives(*asks, turns=rest).stops(0.0, 9.0) == [(7.0, 8.0)]
    assert drives(*asks, turns=rest, state="safe").stops(0.0, 9.0) == [(5.0, 8.0)]
    assert drives(*asks, turns=Timeline(True)).stops(0.0, 9.0) == []


def test_a_boat_sails_again_when_it_decides_anew_even_to_rest() -> None:
    still = Timeline(True, (5.0, False))
    witness = drives((0.0, (1, 1)), (5.0, (0, 0)), turns=still)
    assert witness.sails_from(6.0) is None
    witness.decided = [5.0, 6.5, 7.0]
    assert witness.sails_from(6.0) == 6.5
    waits = drives((0.0, (1, 1)), (5.0, (0, 0)), turns=still, state="ready")
    waits.decided = witness.decided
    assert waits.sails_from(6.0) is None


def test_only_thrust_of_one_direction_in_manual_can_show_who_does_not_follow() -> None:
    asks = ((1.0, (1, 0)), (2.0, (-1, 1)), (4.0, (0, 1)))
    witness = drives(*asks, turns=Timeline(False))
    assert witness.asked(0.0, 5.0) == [(1.0, 2.0), (2.0, 4.0), (2.0, 5.0)]
    witness.bridge = Timeline(MANUAL, (3.0, Bridge("HOLD", armed=True)), (3.5, MANUAL))
    assert witness.asked(2.5, 4.5) == [(2.5, 3.0), (3.5, 4.0), (2.5, 3.0), (3.5, 4.5)]
    witness.bridge = Timeline(Bridge("MANUAL", armed=False))
    assert witness.asked(0.0, 5.0) == []


@pytest.mark.parametrize(
    ("thrust_N", "ways"),
    [((1000.0, -500.0), (1, -1)), ((8.0, -4.0), (0, 0)), ((14.0, -7.0), (1, -1))],
)
def test_a_thrust_that_the_link_cannot_tell_from_none_asks_for_nothing(thrust_N, ways) -> None:
    assert directions(np.array(thrust_N)) == ways


def test_decisions_are_read_from_the_bus_and_damaged_ones_are_not() -> None:
    clock = Clock()
    witness = Witness(clock)
    for clock.now_s, thrust_N in ((1.0, (500.0, 500.0)), (2.0, (0.0, 300.0))):
        payload = cdr.encode_decision(decision(thrust=np.array(thrust_N)))
        witness.read(Received("decision", payload, 0))
    witness.read(Received("decision", b"no message", 0))
    assert witness.decided == [1.0, 2.0]
    assert (witness.asks.at(1.5), witness.asks.at(2.5)) == ((1, 1), (0, 1))


def test_events_and_states_are_heard_with_their_times() -> None:
    clock = Clock()
    witness = Witness(clock)
    for clock.now_s, event in (
        (1.0, STATE.at(0, "ready -> active")),
        (5.3, LIDAR_STALE.at(0)),
        (5.3, STATE.at(0, "active -> safe")),
        (9.0, STATE.at(0, "safe -> active")),
        (10.0, STATE_NOW.at(0, "active")),
        (11.0, STATE_NOW.at(0, "ready")),
    ):
        payload = cdr.encode_diagnostics((event,), stamp_ns=0)
        witness.hear(Received("diagnostics", payload, 0))
    witness.hear(Received("diagnostics", b"no message", 0))
    assert witness.heard("lidar_stale", 5.0) == 5.3
    assert witness.heard("lidar_stale", 6.0) is None
    assert witness.states(5.0, 7.0) == {"active", "safe"}
    assert witness.states(6.0, 7.0) == {"safe"}
    assert witness.states(0.0, 0.5) == set()
    assert witness.state.changes(0.0, 20.0) == [1.0, 5.3, 9.0, 11.0]

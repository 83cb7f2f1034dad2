import numpy as np

from twinscrew.hil_sim.faults.pilot import Bridge
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.safety.events import LIDAR_STALE, STATE

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
        witness.look(np.array([100.0, 0.0]) if turns else np.zeros(2), MANUAL)
    return witness


def test_only_changes_are_remembered() -> None:
    witness = saw((0.0, True), (0.1, True), (0.2, False), (0.3, False), (0.4, True))
    assert witness.turns == [(0.0, True), (0.2, False), (0.4, True)]


def test_still_means_still_until_the_end() -> None:
    witness = saw((0.0, True), (5.3, False), (5.4, True), (5.6, False), (8.0, True))
    assert witness.still_since(5.0, 7.0) == 5.6
    assert witness.still_since(5.0, 5.5) is None
    assert witness.still_since(6.0, 7.0) == 6.0


def test_one_propeller_is_enough_to_turn() -> None:
    witness = saw((0.0, False), (1.0, True))
    assert not witness.turning(0.5)
    assert witness.turning(1.5)
    assert witness.turning_from(0.5) == 1.0
    assert witness.turning_from(1.5) == 1.5
    assert saw((0.0, False)).turning_from(0.0) is None


def test_events_and_states_are_heard_with_their_times() -> None:
    clock = Clock()
    witness = Witness(clock)
    for clock.now_s, event in (
        (1.0, STATE.at(0, "ready -> active")),
        (5.3, LIDAR_STALE.at(0)),
        (5.3, STATE.at(0, "active -> safe")),
        (9.0, STATE.at(0, "safe -> active")),
    ):
        payload = cdr.encode_diagnostics((event,), stamp_ns=0)
        witness.hear(Received("diagnostics", payload, 0))
    witness.hear(Received("diagnostics", b"no message", 0))
    assert witness.heard("lidar_stale", 5.0) == 5.3
    assert witness.heard("lidar_stale", 6.0) is None
    assert witness.states(5.0, 7.0) == {"active", "safe"}
    assert witness.states(6.0, 7.0) == {"safe"}

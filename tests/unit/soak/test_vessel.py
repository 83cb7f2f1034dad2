"""What of a soak says something about a boat."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from twinscrew.hil_sim.faults.crew import Made
from twinscrew.hil_sim.faults.plan import Fault, FaultPlan, Promise
from twinscrew.hil_sim.faults.timeline import Span, Timeline
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.hil_sim.soak.vessels import Scheduled, VesselSoak, look_back
from twinscrew.runtime.safety.events import OVERRUN

PROMISE = Promise(fault="scans stop", reaction="neutral", neutral_s=0.5, moves_again_s=1.0)
DROP = Fault(at_s=5.0, for_s=2.0, kind="drop", target="points")
HOG = Fault(at_s=50.0, for_s=5.0, kind="cpu_hog", target="machine")
STOPS = Timeline(False, (0.0, True), (5.4, False), (7.2, True))
SAILS_ON = Timeline(False, (0.0, True))
RESTS = Timeline(False)


def soaked(
    folder: Path,
    turns: Timeline[bool] = STOPS,
    *,
    moves: bool = True,
    late_s: tuple[float, ...] = (),
    standstills: tuple[Span, ...] = (),
) -> VesselSoak:
    """Look back on one vessel that lost its scans, and on another that had the cores taken."""
    (folder / "log.txt").write_text("")
    witness = Witness()
    witness.turns, witness.moves = turns, Timeline(moves)
    witness.events = [(t, OVERRUN.at(0)) for t in late_s]
    made = [Made(0, DROP, 5.0, 7.0), Made(1, HOG, 50.0, 55.0)]
    crew = SimpleNamespace(witnesses=[witness], made=made, ended_s=100.0)
    schedule = [Scheduled(plan=FaultPlan(fault=(DROP,), promise=PROMISE, name="lidar_drop"))]
    return look_back(crew, 0, schedule, list(standstills), folder, [], 0)


def test_a_fault_is_judged_and_told_with_its_time(tmp_path: Path) -> None:
    (judged,) = soaked(tmp_path).faults
    assert (judged.at_s, judged.excuse, judged.verdict.kept) == (5.0, "", True)


def test_a_boat_that_does_not_stop_has_no_excuse(tmp_path: Path) -> None:
    vessel = soaked(tmp_path, SAILS_ON)
    assert [verdict.kept for verdict in vessel.verdicts] == [False]


@pytest.mark.parametrize(("turns", "moves"), [(RESTS, True), (STOPS, False)])
def test_a_boat_that_is_not_under_way_cannot_be_judged(tmp_path, turns, moves: bool) -> None:
    vessel = soaked(tmp_path, turns, moves=moves)
    assert [judged.excuse for judged in vessel.faults] == ["not under way when it began"]
    assert vessel.verdicts == []


@pytest.mark.parametrize(("begin_s", "judged"), [(5.2, 0), (10.9, 0), (4.9, 1), (11.0, 1)])
def test_a_broken_promise_counts_only_if_the_machine_ran(tmp_path, begin_s, judged: int) -> None:
    """From 5 s, when the fault began, to 11 s, when it had settled."""
    still = (Span(begin_s, begin_s + 0.1),)
    assert len(soaked(tmp_path, SAILS_ON, standstills=still).verdicts) == judged


def test_a_promise_that_was_kept_although_the_machine_stood_still_was_kept(tmp_path: Path) -> None:
    (verdict,) = soaked(tmp_path, standstills=(Span(5.2, 6.0),)).verdicts
    assert verdict.kept


@pytest.mark.parametrize(
    ("late_s", "missed"),
    [
        (3.0, (1, 0, 0)),
        (6.0, (0, 1, 0)),
        (9.9, (0, 1, 0)),
        (10.1, (1, 0, 0)),
        (52.0, (0, 1, 0)),
        (30.2, (0, 0, 1)),
        (30.5, (1, 0, 0)),
        (100.5, (0, 0, 0)),
    ],
)
def test_a_late_decision_is_counted_where_it_belongs(tmp_path, late_s: float, missed) -> None:
    """A fault from 5 s to 7 s, one of the machine's from 50 s to 55 s; the soak ends at 100 s."""
    still = (Span(30.0, 30.1),)
    assert soaked(tmp_path, late_s=(late_s,), standstills=still).missed == missed

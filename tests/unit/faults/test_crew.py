"""Faults begin and end at their times, on the messages that are meant; autopilots are real ones."""

from collections.abc import Iterator

import numpy as np
import pytest
from tests.harness.boat import odometry

from twinscrew.hil_sim.faults.crew import FaultyCrew
from twinscrew.hil_sim.faults.plan import Fault, FaultPlan
from twinscrew.hil_sim.faults.rig import Rig

TICK_S = 0.05


class Inner:
    """The crew that everything is handed to: a diary."""

    exchange_s = TICK_S
    pids = (1,)
    down = frozenset()
    late_s = 0.0

    def __init__(self) -> None:
        self.delivered: list[tuple[float, str, bytes]] = []
        self.done: list[tuple[float, str]] = []
        self.now_s = 0.0

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:
        self.delivered.append((round(self.now_s, 3), topic, payload))

    def exchange(self, vessel: int, now_s: float, measured: object) -> None:
        self.now_s = now_s

    def thrust_N(self):
        return np.zeros((1, 2))

    def kill(self, vessel: int) -> None:
        self.done.append((round(self.now_s, 3), "kill"))

    def start_again(self, vessel: int) -> None:
        self.done.append((round(self.now_s, 3), "start"))


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig(0, 1, lambda: 0.0)
    yield made
    made.net.close()
    made.close()


def fault(kind: str, target: str, at_s: float, for_s: float = 1.0, **parameters: object) -> Fault:
    return Fault(at_s=at_s, for_s=for_s, kind=kind, target=target, parameters=parameters)


def sail(rig: Rig, *faults: Fault, seconds: float = 4.0) -> tuple[Inner, FaultyCrew]:
    """The goal comes after half a second; a scan in every tick tells its number."""
    inner = Inner()
    crew = FaultyCrew(inner, [rig], [FaultPlan(fault=faults)], 0)
    for tick in range(round(seconds / TICK_S)):
        inner.now_s = now_s = tick * TICK_S
        if tick == 10:
            crew.deliver(0, "goal", b"goal", now_s)
        crew.deliver(0, "points", b"%d" % tick, now_s)
        crew.exchange(0, now_s, odometry(now_s))
    return inner, crew


def test_a_fault_counts_from_the_goal_and_lasts_as_long_as_it_says(rig: Rig) -> None:
    inner, crew = sail(rig, fault("drop", "points", 1.0, 0.5))
    came = [int(payload) for _, topic, payload in inner.delivered if topic == "points"]
    lost = sorted(set(range(80)) - set(came))
    assert lost == list(range(31, 41))
    (made,) = crew.made
    assert made.fault.kind == "drop"
    assert made.end_s > made.begin_s


def test_a_fault_at_the_beginning_meets_the_goal_itself(rig: Rig) -> None:
    inner, _ = sail(rig, fault("drop", "goal", 0.0, 1.0), fault("goal", "runtime", 2.0, 0.0))
    assert [(t, p) for t, topic, p in inner.delivered if topic == "goal"] == [(2.5, b"goal")]


def test_a_runtime_is_killed_and_started_again(rig: Rig) -> None:
    inner, _ = sail(rig, fault("kill", "runtime", 1.0, 1.5))
    assert inner.done == [(1.5, "kill"), (3.0, "start")]


def test_late_messages_come_by_themselves(rig: Rig) -> None:
    inner, _ = sail(rig, fault("delay", "points", 0.5, 2.0, delay_s=0.3))
    came = {int(p): t for t, topic, p in inner.delivered if topic == "points"}
    assert came[10] == pytest.approx(0.5)
    assert came[25] == pytest.approx(25 * TICK_S + 0.3, abs=TICK_S)
    assert sorted(came) == list(range(80))

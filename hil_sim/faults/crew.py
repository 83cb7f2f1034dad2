"""The real-time crew with faults between it and the world, and a witness of what follows."""

from __future__ import annotations

import time
from functools import partial
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from twinscrew.hil_sim.drivers.realtime import RealtimeCrew
from twinscrew.hil_sim.faults.actions import Action, action_of
from twinscrew.hil_sim.faults.plan import Fault, FaultPlan
from twinscrew.hil_sim.faults.rig import TOPICS, Rig
from twinscrew.hil_sim.faults.witness import Witness
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Odometry

ENABLE_EVERY_S = 0.2
"""[s] How often an operator says that thrusters by topic may be driven."""


class Made(NamedTuple):
    """A fault that was made."""

    vessel: int
    fault: Fault
    begin_s: float
    """[s] By the monotonic clock."""
    end_s: float
    """[s] When it was over, at the latest with the voyage."""


class FaultyCrew:
    """A `Crew` around the real one; faults begin to count when the vessels get their goals."""

    def __init__(
        self, crew: RealtimeCrew, rigs: list[Rig], plans: list[FaultPlan], seed: int
    ) -> None:
        """Join them.

        Parameters
        ----------
        crew
            The runtimes; its fleet is the rigs'.
        plans
            One a vessel.
        seed
            What messages' fates are drawn from.
        """
        self.exchange_s = crew.exchange_s
        self.witnesses = [Witness() for _ in rigs]
        """One a vessel."""
        self.made: list[Made] = []
        self.ended_s = 0.0
        """[s] When the voyage was over, by the monotonic clock."""
        self._crew, self._rigs = crew, rigs
        self._begin_s: float | None = None
        streams = np.random.SeedSequence(seed).spawn(len(rigs))
        self._waiting: list[tuple[int, Fault, Action]] = []
        self._acting: list[tuple[int, Fault, Action, float]] = []
        for rig, plan, stream in zip(rigs, plans, streams, strict=True):
            rng = np.random.default_rng(stream)
            for fault in plan.fault:
                action = action_of(fault, rig, crew, rng)
                self._waiting.append((rig.vessel, fault, action))

    def __enter__(self) -> Self:
        self._crew.__enter__()
        for rig, witness in zip(self._rigs, self.witnesses, strict=True):
            self._crew.listen(rig.vessel, "diagnostics", witness.hear)
            self._crew.listen(rig.vessel, "decision", witness.read)
            if rig.thrusters is not None:
                for side, topic in enumerate(("thrust_left", "thrust_right")):
                    self._crew.listen(rig.vessel, topic, partial(rig.thrusters.take, side))
        return self

    @property
    def pids(self) -> tuple[int, ...]:
        """The runtimes' process ids."""
        return self._crew.pids

    @property
    def down(self) -> frozenset[int]:
        """Vessels whose runtimes were killed and not started again."""
        return self._crew.down

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.ended_s = time.monotonic()
        for vessel, fault, action, begin_s in self._acting:
            action.end()
            self.made.append(Made(vessel, fault, begin_s, self.ended_s))
        self._crew.close()
        for rig in self._rigs:
            rig.close()

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:
        """See `Crew`."""
        if topic == "goal":
            self._rigs[vessel].goal = payload
            self._begin_s = now_s if self._begin_s is None else self._begin_s
            self._step(now_s)
        for arrived in self._rigs[vessel].lines[topic].put(payload, now_s):
            self._crew.deliver(vessel, topic, arrived, now_s)

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Crew`."""
        self._step(now_s)
        rig = self._rigs[vessel]
        for topic in TOPICS:
            for arrived in rig.lines[topic].due(now_s):
                self._crew.deliver(vessel, topic, arrived, now_s)
        if rig.thrusters is not None and now_s - rig.enable_s >= ENABLE_EVERY_S:
            rig.enable_s = now_s
            for arrived in rig.lines["enable"].put(cdr.encode_enable(True), now_s):
                self._crew.deliver(vessel, "enable", arrived, now_s)
        self._crew.exchange(vessel, now_s, odometry)
        autopilot, speed_m_s = rig.net.autopilot, float(np.hypot(*odometry.velocity_B[:2]))
        self.witnesses[vessel].look(autopilot.thrust_command_N(), autopilot.bridge, speed_m_s)

    def is_ready(self, vessel: int) -> bool:
        """See `Crew`."""
        return self._crew.is_ready(vessel)

    def trial_outcome(self, vessel: int) -> str:
        """See `Crew`."""
        return self._crew.trial_outcome(vessel)

    def why_not_ready(self, vessel: int) -> str:
        """See `Crew`."""
        return self._crew.why_not_ready(vessel)

    def thrust_N(self) -> Float64:
        """See `Crew`."""
        return self._crew.thrust_N()

    def retire(self, vessel: int) -> None:
        """See `Crew`."""
        self._crew.retire(vessel)

    def keep_pace(self, now_s: float) -> None:
        """See `Crew`."""
        self._crew.keep_pace(now_s)

    def check(self) -> None:
        """See `Crew`."""
        self._crew.check()

    @property
    def late_s(self) -> float:
        """[s] The most that simulated time fell behind the clock."""
        return self._crew.late_s

    def _step(self, now_s: float) -> None:
        """Begin and end what is due."""
        if self._begin_s is None:
            return
        since_s = now_s - self._begin_s
        for made in [made for made in self._acting if made[1].end_s <= since_s]:
            self._acting.remove(made)
            vessel, fault, action, begin_s = made
            action.end()
            self.made.append(Made(vessel, fault, begin_s, time.monotonic()))
        for planned in [planned for planned in self._waiting if planned[1].at_s <= since_s]:
            self._waiting.remove(planned)
            vessel, fault, action = planned
            self._acting.append((vessel, fault, action, time.monotonic()))
            action.begin()

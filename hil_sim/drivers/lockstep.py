"""Lock-step: each vessel's runtime steps when it is its turn, and time waits until it has.

The same code as on the boat, with the same bytes in and out; only the sockets and the clock are
missing. Everything is determined by the seed, whether the runtimes live in this process or in
others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.drivers.voyage import ODOMETRY_S
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.session import RunSummary
from twinscrew.runtime.app.stepped import SteppedRuntime
from twinscrew.runtime.messages.types import Float64, Odometry


class Stepped(Protocol):
    """A runtime that moves only when it is told to, here or elsewhere."""

    @property
    def engaged(self) -> bool:
        """Whether the policy has the propellers."""

    def deliver(self, topic: str, payload: bytes, now_s: float) -> bytes:
        """Take in a message, and give the MAVLink bytes that it makes the runtime send at once."""

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Take in MAVLink bytes, and give those that answer them."""

    def summary(self) -> RunSummary:
        """Say what happened, when the voyage is over."""

    def close(self) -> None:
        """Finish the recording; closing twice is closing once."""


class SteppedCrew:
    """Runtimes and autopilots, joined by bytes in simulated time."""

    exchange_s = ODOMETRY_S

    def __init__(
        self,
        runtimes: Sequence[Stepped],
        configs: Sequence[RuntimeConfig],
        autopilot: RoverAutopilotSettings | None = None,
    ) -> None:
        """Give each of the runtimes an autopilot."""
        settings = autopilot or RoverAutopilotSettings()
        self._runtimes = runtimes
        self._autopilots = [
            RoverAutopilot(settings, config.autopilot.system_id) for config in configs
        ]

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:
        """See `Crew`."""
        command = self._runtimes[vessel].deliver(topic, payload, now_s)
        if command:
            self._autopilots[vessel].receive(command, now_s)

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Crew`."""
        autopilot = self._autopilots[vessel]
        answer = self._runtimes[vessel].exchange(autopilot.step(now_s, odometry), now_s)
        autopilot.receive(answer, now_s)

    def is_ready(self, vessel: int) -> bool:
        """See `Crew`."""
        return self._runtimes[vessel].engaged

    def thrust_N(self) -> Float64:
        """See `Crew`."""
        return np.array([autopilot.thrust_command_N() for autopilot in self._autopilots])

    def retire(self, vessel: int) -> None:
        """See `Crew`."""
        self._runtimes[vessel].close()

    def keep_pace(self, now_s: float) -> None:
        """Wait for nothing: simulated time is as fast as the machine."""

    def check(self) -> None:
        """Nothing can have died unnoticed: every step is answered."""

    def summaries(self) -> list[RunSummary]:
        """Give what each runtime says of its run, when it is over."""
        return [runtime.summary() for runtime in self._runtimes]

    def close(self) -> None:
        """Finish all recordings."""
        for runtime in self._runtimes:
            runtime.close()


class LockstepCrew(SteppedCrew):
    """All vessels' runtimes, in this process."""

    def __init__(
        self,
        configs: list[RuntimeConfig],
        *,
        epoch_ns: int,
        autopilot: RoverAutopilotSettings | None = None,
    ) -> None:
        self.vessels = [SteppedRuntime(config, epoch_ns=epoch_ns) for config in configs]
        super().__init__(self.vessels, configs, autopilot)

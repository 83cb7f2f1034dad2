"""Lock-step: each vessel's runtime steps when it is its turn, and time waits until it has.

The runtimes step in this process, or each in a process of its own, led over Zenoh.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from types import TracebackType
from typing import Protocol, Self

import msgspec
import numpy as np
from msgspec.structs import replace

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.children import undisturbed
from twinscrew.hil_sim.drivers.processes import LOOPBACK, START_LIMIT_S, STOP_LIMIT_S, free_port
from twinscrew.hil_sim.drivers.voyage import ODOMETRY_S
from twinscrew.hil_sim.last_words import ended
from twinscrew.runtime.bus.steps import Asker
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.errors import BusError, LinkError
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.vessel.config import RuntimeConfig, inputs_of
from twinscrew.runtime.vessel.lockstep import SERVICE, Orders, Rest, Step, SteppedRuntime
from twinscrew.runtime.vessel.pipeline import Pipeline
from twinscrew.runtime.vessel.summary import RunSummary


class Stepped(Protocol):
    """A runtime that moves only when it is told to, here or elsewhere."""

    @property
    def engaged(self) -> bool:
        """Whether the policy has the propellers."""

    @property
    def trial_outcome(self) -> str:
        """The event that ended its trial, once the boat has braked; empty before."""

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
        propellers: Sequence[PaddleSettings] = (),
    ) -> None:
        """Give each of the runtimes an autopilot.

        `propellers` say what the autopilots' outputs mean; none: what the runtimes take them for.
        """
        settings = autopilot or RoverAutopilotSettings()
        self._runtimes = runtimes
        scales = propellers or [config.autopilot.paddles for config in configs]
        self._autopilots = [
            RoverAutopilot(replace(settings, paddles=scale), config.autopilot.system_id)
            for config, scale in zip(configs, scales, strict=True)
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

    def trial_outcome(self, vessel: int) -> str:
        """See `Crew`."""
        return self._runtimes[vessel].trial_outcome

    def why_not_ready(self, vessel: int) -> str:
        """See `Crew`."""
        rover = self._autopilots[vessel].rover
        return rover.refusal or f"{rover.mode.name}, {'armed' if rover.armed else 'disarmed'}"

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
        pipelines: Sequence[Pipeline | None] | None = None,
        propellers: Sequence[PaddleSettings] = (),
    ) -> None:
        """Start them; `pipelines` are in place of the configured ones."""
        self.vessels = [
            SteppedRuntime(config, epoch_ns=epoch_ns, pipeline=pipeline)
            for config, pipeline in zip(configs, pipelines or [None] * len(configs), strict=True)
        ]
        super().__init__(self.vessels, configs, autopilot, propellers)


# -- Lock-step across processes: each vessel's runtime in one of its own, led over Zenoh.
#
# Nothing is left to timing: the simulator sends a message by its topic, says by a question that it
# is its turn, and waits for the answer before anything else happens. The decisions are, to the last
# bit, those of lock-step in one process.

PATIENCE_S = 60.0
"""[s] How long a step may take before the runtime is taken for hung."""
MODULE = "twinscrew.runtime.vessel.lockstep"


class RemoteRuntime:
    """A runtime in a process of its own; a `Stepped`."""

    def __init__(
        self, config: RuntimeConfig, bus: ZenohBus, endpoint: str, *, epoch_ns: int
    ) -> None:
        """Start it; `bus`, in the vessel's namespace, listens at `endpoint`."""
        self._name = config.name
        self._inputs = inputs_of(config)
        self._bus = bus
        self._rest = Rest(b"", engaged=False)
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (closed in `kill`)
        settings = msgspec.structs.replace(config.bus, connect=(endpoint,), lossless=True)
        orders = Orders(msgspec.structs.replace(config, bus=settings), epoch_ns)
        with tempfile.TemporaryFile() as told:
            told.write(msgspec.msgpack.encode(orders))
            told.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-m", MODULE], stdin=told, stderr=self._log
            )
        self._asker = Asker(bus, SERVICE, PATIENCE_S)

    @property
    def engaged(self) -> bool:
        """See `Stepped`."""
        return self._rest.engaged

    @property
    def trial_outcome(self) -> str:
        """See `Stepped`."""
        return self._rest.trial_outcome

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid

    def wait(self) -> None:
        """Wait until it can be led.

        Raises
        ------
        LinkError
            It ended, or does not listen in time.
        """
        waited_s = 0.0
        while not self._asker.is_answered(0.2) or not self._bus.wait_for_subscribers(
            self._inputs, 0.2
        ):
            waited_s += 0.2
            self._check()
            if waited_s > START_LIMIT_S:
                raise LinkError(f"the runtime of {self._name} does not listen")

    def deliver(self, topic: str, payload: bytes, now_s: float) -> bytes:
        """See `Stepped`."""
        if topic not in self._inputs:
            return b""
        self._bus.publish(topic, payload)
        return self._go(Step(now_s, topic=topic)).data

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """See `Stepped`."""
        return self._go(Step(now_s, data=data)).data

    def summary(self) -> RunSummary:
        """See `Stepped`."""
        self.close()
        if self._rest.summary is None:
            raise LinkError(f"the runtime of {self._name} left no summary")
        return self._rest.summary

    def close(self) -> None:
        """See `Stepped`; the process ends."""
        if self._rest.summary is None and self._process.poll() is None:
            self._go(Step(0.0, last=True))
            self._process.wait(STOP_LIMIT_S)

    def kill(self) -> None:
        """End the process, however it feels about it."""
        self._process.kill()
        self._process.wait()
        self._log.close()

    def _go(self, step: Step) -> Rest:
        try:
            answer = self._asker.ask(msgspec.msgpack.encode(step))
        except BusError:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(STOP_LIMIT_S)  # if it died, Zenoh may know it first
            self._check()
            raise
        self._rest = msgspec.msgpack.decode(answer, type=Rest)
        return self._rest

    def _check(self) -> None:
        """Raise, with its last words, if the process has ended."""
        if self._process.poll() is not None:
            self._log.seek(0)
            raise ended(f"the runtime of {self._name}", self._process, self._log.read())


class ProcessCrew(SteppedCrew):
    """All vessels' runtimes, each in a process of its own; a context."""

    def __init__(
        self,
        configs: list[RuntimeConfig],
        *,
        epoch_ns: int,
        autopilot: RoverAutopilotSettings | None = None,
        propellers: Sequence[PaddleSettings] = (),
    ) -> None:
        self.vessels: list[RemoteRuntime] = []
        super().__init__(self.vessels, configs, autopilot, propellers)
        self._configs = configs
        self._epoch_ns = epoch_ns
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        endpoint = f"tcp/{LOOPBACK}:{free_port()}"
        try:
            self._start(endpoint)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.close()

    def _start(self, endpoint: str) -> None:
        settings = ZenohSettings(listen=(endpoint,), connect=(), lossless=True, node="simulator")
        bus = ZenohBus(settings, self._configs[0].name)
        self._stack.callback(bus.close)
        for config in self._configs:
            mine = bus.within(config.name)
            with undisturbed():
                vessel = RemoteRuntime(config, mine, endpoint, epoch_ns=self._epoch_ns)
                self._stack.callback(vessel.kill)
            self.vessels.append(vessel)
        for vessel in self.vessels:
            vessel.wait()

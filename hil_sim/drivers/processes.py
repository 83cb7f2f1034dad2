"""Lock-step across processes: each vessel's runtime in one of its own, led over Zenoh.

Nothing is left to timing: the simulator sends a message by its topic, says by a question that it
is its turn, and waits for the answer before anything else happens. The decisions are, to the last
bit, those of lock-step in one process.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from contextlib import ExitStack, suppress
from types import TracebackType
from typing import Self

import msgspec

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilotSettings
from twinscrew.hil_sim.children import undisturbed
from twinscrew.hil_sim.drivers.lockstep import SteppedCrew
from twinscrew.hil_sim.drivers.ports import LOOPBACK, free_port
from twinscrew.hil_sim.drivers.runtime_process import START_LIMIT_S, STOP_LIMIT_S
from twinscrew.hil_sim.last_words import ended
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.session import RunSummary, inputs_of
from twinscrew.runtime.app.stepped_process import SERVICE, Orders, Rest, Step
from twinscrew.runtime.bus.steps import Asker
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.errors import BusError, LinkError

PATIENCE_S = 60.0
"""[s] How long a step may take before the runtime is taken for hung."""
MODULE = "twinscrew.runtime.app.stepped_process"


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
    ) -> None:
        self.vessels: list[RemoteRuntime] = []
        super().__init__(self.vessels, configs, autopilot)
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

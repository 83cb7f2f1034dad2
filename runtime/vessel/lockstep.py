"""One vessel's runtime that moves only when it is told to: for simulated time.

The same controller, outlet and recorder as on the boat, with the same bytes in and out; only the
sockets and the clock are missing. A simulator steps it in its own process, or in another one
(`stepped_process`), to the same decisions.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Final

import msgspec

from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.bus.inbox import Inbox
from twinscrew.runtime.bus.steps import Answerer
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import BusError, TwinscrewError
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND
from twinscrew.runtime.vessel.config import RuntimeConfig, sensor_of
from twinscrew.runtime.vessel.outputs import Frames, Outlet
from twinscrew.runtime.vessel.realtime import RunSummary, inputs_of, metadata_of
from twinscrew.runtime.vessel.summary import Latencies
from twinscrew.runtime.vessel.vessel import make_controller


class SteppedRuntime:
    """One vessel's runtime, without sockets and clock."""

    def __init__(self, config: RuntimeConfig, *, epoch_ns: int) -> None:
        """Assemble it.

        Parameters
        ----------
        config
            The vessel's configuration; what it says of connections is not used.
        epoch_ns
            [ns] The simulation's begin, for the recording's log times.
        """
        self.config = config
        self.controller = make_controller(config, looks_first=False)
        self.latencies = Latencies()
        self._inputs = inputs_of(config)
        self._epoch_ns = epoch_ns
        self._now_s = 0.0
        self._recorder = self._open_recorder()
        self.outlet = Outlet(
            None,
            self._recorder,
            vessel=config.name,
            frames=Frames(sensor_of(config)),
            clock_ns=self._log_time,
        )

    @property
    def engaged(self) -> bool:
        """Whether the policy has the propellers."""
        return self.controller.engaged

    def deliver(self, topic: str, payload: bytes, now_s: float) -> bytes:
        """Take in a message, and give the MAVLink bytes that it makes us send at once."""
        if topic not in self._inputs:
            return b""
        sent = self._own_odometry(now_s) if topic == "points" else []
        return b"".join([*sent, self._feed(topic, payload, now_s)])

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Take in MAVLink bytes, and give those that answer them."""
        self._now_s = now_s
        controller = self.controller
        controller.from_autopilot(data, now_s)
        sent = self._own_odometry(now_s)
        engagement, events = controller.supervise(now_s)
        if engagement is not None:
            self.outlet.record("engagement", engagement)
            controller.take_in("engagement", engagement, now_s)
        self.outlet.happened(events)
        return b"".join([*sent, controller.command(now_s)])

    def summary(self) -> RunSummary:
        """Say what happened so far."""
        return RunSummary(
            name=self.config.name,
            decisions=self.outlet.decisions,
            decisions_sha256=self.outlet.sha256,
            latency_ms=self.latencies.summary().as_dict(),
            wire_latency_ms=Latencies().summary().as_dict(),
            overruns=0,
            passed_over={},
            unrecorded=0,
        )

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder is not None:
            self._recorder.close()

    def _own_odometry(self, now_s: float) -> list[bytes]:
        return [self._feed("odometry", own, now_s) for own in self.controller.own_odometry()]

    def _feed(self, topic: str, payload: bytes, now_s: float) -> bytes:
        self._now_s = now_s
        begin_ns = time.perf_counter_ns()
        self.outlet.record(topic, payload)
        handled = self.controller.take_in(topic, payload, now_s)
        command = b""
        if handled.decision is not None:
            command = self.controller.command(now_s)
            self.latencies.add((time.perf_counter_ns() - begin_ns) / 1e6)
            why = self.controller.explain(handled.decision) if self.outlet.is_told else None
            self.outlet.decided(handled.decision, self.controller.thrust, why)
        self.outlet.happened(handled.events)
        return command

    def _log_time(self) -> int:
        return self._epoch_ns + round(self._now_s * NANOSECONDS_PER_SECOND)

    def _open_recorder(self) -> Recorder | None:
        folder = self.config.recording.folder
        if not folder:
            return None
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        metadata = metadata_of(self.config, self.controller.core.pipeline.policy)
        return Recorder(path / "recording", self.config.name, metadata, lossless=True)


# -- A stepped runtime in a process of its own, led over Zenoh.
#
# Sensor messages come by their topics, as on the boat. Then the leader says by a question which of
# them it is the turn of, or hands over the autopilot's bytes, with the time; the answer carries what
# the runtime sends to the autopilot, and says that it has come to rest.
#
#     python -m twinscrew.runtime.vessel.lockstep     with an `Orders` in MessagePack as its input

SERVICE: Final = "lockstep"
ON_ITS_WAY_S: Final = 30.0
"""[s] A message that was announced may take so long to arrive."""
LEADERLESS_S: Final = 120.0
"""[s] Without a step for so long the leader is taken for dead."""
USAGE_ERROR: Final = 2


class Orders(msgspec.Struct, frozen=True):
    """What a process is started with."""

    config: RuntimeConfig
    epoch_ns: int
    """[ns] The simulation's begin."""


class Step(msgspec.Struct, frozen=True):
    """What to do next."""

    now_s: float
    """[s] Simulated time."""
    topic: str = ""
    """The topic whose next message to take in; empty: talk with the autopilot."""
    data: bytes = b""
    """From the autopilot."""
    last: bool = False
    """Close everything: the voyage has ended."""


class Rest(msgspec.Struct, frozen=True):
    """What came of a step."""

    data: bytes
    """For the autopilot."""
    engaged: bool
    """Whether the policy has the propellers."""
    summary: RunSummary | None = None
    """After the last step."""


def main() -> int:
    """Run one vessel's runtime until its last step."""
    orders = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=Orders)
    try:
        follow(orders)
    except TwinscrewError as error:
        print(f"twinscrew: error: {error}", file=sys.stderr)
        return USAGE_ERROR
    return 0


def follow(orders: Orders) -> None:
    """Do what the leader says, step by step."""
    config = orders.config
    runtime = SteppedRuntime(config, epoch_ns=orders.epoch_ns)
    bus = ZenohBus(config.bus, config.name)
    inbox = Inbox()
    inbox.listen(bus, inputs_of(config))
    leader = Answerer(bus, SERVICE)
    try:
        over = False
        while not over:
            step = msgspec.msgpack.decode(leader.question(LEADERLESS_S), type=Step)
            leader.answer(msgspec.msgpack.encode(_rest(runtime, inbox, step)))
            over = step.last
    finally:
        runtime.close()
        bus.close()


def _rest(runtime: SteppedRuntime, inbox: Inbox, step: Step) -> Rest:
    """Go a step."""
    if step.last:
        runtime.close()
        return Rest(b"", runtime.engaged, runtime.summary())
    if not step.topic:
        return Rest(runtime.exchange(step.data, step.now_s), runtime.engaged)
    messages = inbox.wait(ON_ITS_WAY_S)
    if [message.topic for message in messages] != [step.topic]:
        came = ", ".join(message.topic for message in messages) or "nothing"
        raise BusError(f"out of step: {step.topic} was announced, {came} came")
    data = runtime.deliver(step.topic, messages[0].payload, step.now_s)
    return Rest(data, runtime.engaged)


if __name__ == "__main__":
    sys.exit(main())

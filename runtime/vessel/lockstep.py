"""One vessel's runtime that moves only when it is told to: for simulated time.

The same vessel, publisher and recorder as on the boat, with the same bytes in and out; only the
sockets and the clock are missing. A simulator steps it in its own process (`SteppedRuntime`), or in
another one that it leads over Zenoh, to the same decisions:

    python -m twinscrew.runtime.vessel.lockstep     with an `Orders` in MessagePack as its input

There sensor messages come by their topics, as on the boat. Then the leader asks by a question to
take in one of them, or hands over the autopilot's bytes, with the time; the answer carries what the
runtime sends to the autopilot, and says that it has come to rest.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec

from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.errors import BusError, TwinscrewError
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND
from twinscrew.runtime.recording.recorder import Recorder
from twinscrew.runtime.vessel.config import RuntimeConfig, inputs_of
from twinscrew.runtime.vessel.outputs import Publisher
from twinscrew.runtime.vessel.pipeline import Pipeline
from twinscrew.runtime.vessel.summary import Latencies, RunSummary, metadata_of
from twinscrew.runtime.vessel.vessel import make_vessel

if TYPE_CHECKING:
    from twinscrew.runtime.bus.base import Inbox

SERVICE: Final = "lockstep"
ON_ITS_WAY_S: Final = 30.0
"""[s] A message that was announced may take so long to arrive."""
LEADERLESS_S: Final = 120.0
"""[s] Without a step for so long the leader is taken for dead."""
USAGE_ERROR: Final = 2


class SteppedRuntime:
    """One vessel's runtime, without sockets and clock.

    Parameters
    ----------
    config
        The vessel's configuration; what it says of connections is not used.
    epoch_ns
        [ns] The simulation's begin, for the recording's log times.
    pipeline
        In place of the configured one (`make_pipeline`).
    """

    def __init__(
        self, config: RuntimeConfig, *, epoch_ns: int, pipeline: Pipeline | None = None
    ) -> None:
        self.config = config
        self.vessel = make_vessel(config, pipeline=pipeline, looks_first=False)
        self.latencies = Latencies()
        self._inputs = inputs_of(config)
        self._epoch_ns = epoch_ns
        self._now_s = 0.0
        self._recorder = self._open_recorder()
        self.publisher = Publisher(
            None,
            self._recorder,
            vessel=config.name,
            frames=self.vessel.frames,
            clock_ns=self._log_time,
        )

    @property
    def engaged(self) -> bool:
        """Whether the policy has the propellers."""
        return self.vessel.engaged

    @property
    def trial_outcome(self) -> str:
        """The event that ended its trial, once the boat has braked; empty before."""
        trial = self.vessel.pipeline.trial
        return "" if trial is None or trial.braking else trial.outcome

    def deliver(self, topic: str, payload: bytes, now_s: float) -> bytes:
        """Take in a message, and give the MAVLink bytes that it makes us send at once."""
        if topic not in self._inputs:
            return b""
        self._now_s = now_s
        self.publisher.came(topic, payload)
        begin_ns = time.perf_counter_ns()
        out, explanation = self.vessel.handle(Received(topic, payload, 0), now_s), None
        if out.decision is not None:
            self.latencies.add((time.perf_counter_ns() - begin_ns) / 1e6)
            self.vessel.report.decided(out.decision, 0.0, now_s)  # in simulated time, at once
            if self.publisher.has_listeners:
                explanation = self.vessel.explain(out.decision)
        self.publisher.publish(out, explanation)
        return out.autopilot

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Take in MAVLink bytes, and give those that answer them."""
        self._now_s = now_s
        self.publisher.publish(self.vessel.receive(data, now_s))
        out = self.vessel.tick(now_s)
        self.publisher.publish(out)
        return out.autopilot

    def summary(self) -> RunSummary:
        """Say what happened so far."""
        return RunSummary(
            name=self.config.name,
            decisions=self.publisher.decisions,
            decisions_sha256=self.publisher.sha256,
            latency_ms=self.latencies.summary().as_dict(),
        )

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder is not None:
            self._recorder.close()

    def _log_time(self) -> int:
        return self._epoch_ns + round(self._now_s * NANOSECONDS_PER_SECOND)

    def _open_recorder(self) -> Recorder | None:
        folder = self.config.recording.folder
        if not folder:
            return None
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        metadata = metadata_of(self.config, self.vessel.pipeline.policy)
        return Recorder(path / "recording", self.config.name, metadata, lossless=True)


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
    """Close everything: the simulation has ended."""


class Rest(msgspec.Struct, frozen=True):
    """What came of a step."""

    data: bytes
    """For the autopilot."""
    engaged: bool
    """Whether the policy has the propellers."""
    summary: RunSummary | None = None
    """After the last step."""
    trial_outcome: str = ""
    """The event that ended the trial, if there was one and it has."""


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
    # Zenoh takes a while to import: who steps a runtime in its own process needs none.
    from twinscrew.runtime.bus.base import Inbox
    from twinscrew.runtime.bus.steps import Answerer
    from twinscrew.runtime.bus.zenoh import ZenohBus

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
        return Rest(b"", runtime.engaged, runtime.summary(), runtime.trial_outcome)
    if not step.topic:
        data = runtime.exchange(step.data, step.now_s)
        return Rest(data, runtime.engaged, trial_outcome=runtime.trial_outcome)
    messages = inbox.wait(ON_ITS_WAY_S)
    if [message.topic for message in messages] != [step.topic]:
        came = ", ".join(message.topic for message in messages) or "nothing"
        raise BusError(f"out of step: {step.topic} was announced, {came} came")
    data = runtime.deliver(step.topic, messages[0].payload, step.now_s)
    return Rest(data, runtime.engaged, trial_outcome=runtime.trial_outcome)


if __name__ == "__main__":
    sys.exit(main())

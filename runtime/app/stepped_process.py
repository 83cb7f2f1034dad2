"""A stepped runtime in a process of its own, led over Zenoh.

Sensor messages come by their topics, as on the boat. Then the leader says by a question which of
them it is the turn of, or hands over the autopilot's bytes, with the time; the answer carries what
the runtime sends to the autopilot, and says that it has come to rest.

    python -m twinscrew.runtime.app.stepped_process     with an `Orders` in MessagePack as its input
"""

from __future__ import annotations

import sys
from typing import Final

import msgspec

from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.session import RunSummary, inputs_of
from twinscrew.runtime.app.stepped import SteppedRuntime
from twinscrew.runtime.bus.base import Inbox
from twinscrew.runtime.bus.steps import Answerer
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import BusError, TwinscrewError

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

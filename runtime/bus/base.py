"""What a bus is: payloads of named topics between the programs of one or several vessels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol, Self, TypeAlias

from twinscrew.runtime.errors import BusError, one_of
from twinscrew.runtime.messages.topics import TOPICS, Topic


class Received(NamedTuple):
    """A message as it came in."""

    topic: str
    """A name of `TOPICS`."""
    payload: bytes
    received_ns: int
    """[ns] Monotonic clock, not the message's stamp; 0 where there is no clock (lock-step)."""
    sent_ns: int = 0
    """[ns] The sender's wall clock; 0 if it did not say."""


Receiver: TypeAlias = Callable[[Received], None]
"""Takes a message. It may be called from another thread and must return at once."""


class Bus(Protocol):
    """Carries payloads. Topics are names of `TOPICS`, within one vessel's namespace."""

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a payload to everyone who listens; nobody is an error.

        Raises
        ------
        BusError
            The bus is closed, or there is no such topic.
        """

    def subscribe(self, topic: str, receive: Receiver) -> None:
        """Have `receive` called with every message of a topic from now on.

        Raises
        ------
        BusError
            The bus is closed, or there is no such topic.
        """

    @property
    def missing(self) -> Mapping[str, int]:
        """How many messages to us are missing, by what became of them: "points too large"."""

    def within(self, namespace: str) -> Self:
        """Give the same bus as seen from another vessel's namespace."""

    def close(self) -> None:
        """Stop receiving and sending; closing twice is closing once."""


def find_topic(name: str) -> Topic:
    """Give a topic of the table; a `BusError` lists them if it is not there."""
    topic = TOPICS.get(name)
    if topic is None:
        raise BusError(f"topic {one_of(name, TOPICS)}")
    return topic

"""Questions and answers over Zenoh: one program tells another to go a step, and waits until it has.

Zenoh's queries carry them. An answer says that the step is done, so that nothing is left to
timing: the same questions in the same order give the same answers, however slow the machine is.
"""

from __future__ import annotations

import queue
import time
from typing import Final

import zenoh

from twinscrew.runtime.bus.zenoh import ZenohBus, in_short
from twinscrew.runtime.errors import BusError

_POLL_S: Final = 0.005
"""[s] How often to look whether somebody answers."""


class Asker:
    """The one that tells the other to go on.

    Parameters
    ----------
    bus
        Its session carries the questions.
    name
        Of the service, within the bus's namespace.
    patience_s
        [s] How long an answer may take.
    """

    def __init__(self, bus: ZenohBus, name: str, patience_s: float) -> None:
        self._name = bus.service_key(name)
        self._patience_s = patience_s
        self._querier = bus.session.declare_querier(
            self._name,
            timeout=patience_s,
            congestion_control=zenoh.CongestionControl.BLOCK,
            express=True,
        )

    def is_answered(self, timeout_s: float) -> bool:
        """Wait until somebody offers the service; False if time ran out."""
        deadline_s = time.monotonic() + timeout_s
        # zenoh's stub calls the status a bool, but it is a struct that is always true.
        while not self._querier.matching_status.matching:  # type: ignore[attr-defined]
            if time.monotonic() > deadline_s:
                return False
            time.sleep(_POLL_S)
        return True

    def ask(self, question: bytes) -> bytes:
        """Ask, and wait for the answer.

        Raises
        ------
        BusError
            Nobody answered in time.
        """
        for reply in self._querier.get(payload=question):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        raise BusError(f"{self._name}: no answer in {self._patience_s:g} s")


class Answerer:
    """The one that goes a step when it is told to; for one thread."""

    def __init__(self, bus: ZenohBus, name: str) -> None:
        self._name = bus.service_key(name)
        self._asked: queue.SimpleQueue[zenoh.Query] = queue.SimpleQueue()
        self._query: zenoh.Query | None = None
        handler = zenoh.handlers.Callback(self._asked.put, indirect=False)
        self._queryable = bus.session.declare_queryable(self._name, handler)

    def question(self, timeout_s: float) -> bytes:
        """Wait for the next question.

        Raises
        ------
        BusError
            Nobody asked in time.
        """
        try:
            self._query = self._asked.get(timeout=timeout_s)
        except queue.Empty:
            raise BusError(f"{self._name}: nobody asked for {timeout_s:g} s") from None
        payload = self._query.payload
        return b"" if payload is None else payload.to_bytes()

    def answer(self, answer: bytes) -> None:
        """Answer the question that came last."""
        query, self._query = self._query, None
        if query is None:
            raise BusError(f"{self._name}: nothing was asked")
        try:
            with query:
                query.reply(self._name, answer)
        except zenoh.ZError as error:
            raise BusError(f"{self._name}: {in_short(error)}") from None

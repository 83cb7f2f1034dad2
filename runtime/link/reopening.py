"""A connection that is opened again after it broke, by a thread: the loop never waits for it.

A TCP server that restarts, a serial adapter that was pulled and put back: both come back by
themselves, in a moment or in an hour. Meanwhile nothing comes and nothing is sent, which the link
takes for what it is (`autopilot_silent`), and the boat stands still.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.carrier import Recognises, Transport, anybody
from twinscrew.runtime.link.transport import open_transport

FIRST_S = 0.1
"""[s] From the break to the first try."""
LONGEST_S = 2.0
"""[s] The most between two tries; each wait is twice the one before."""
TCP_SILENT_S = 5.0
"""[s] A TCP peer that was heard and is silent so long is gone, though nobody closed the connection:
five of MAVLink's heartbeats."""


def reopening(
    connection: str, transport: Transport, recognises: Recognises = anybody
) -> ReopeningTransport:
    """Keep a connection that `open_transport` opened open.

    Parameters
    ----------
    connection
        The string that it was opened from.
    transport
        What came of it.
    recognises
        As `open_transport` takes it.
    """
    silent_s = TCP_SILENT_S if connection.startswith("tcp:") else math.inf

    def reopen() -> Transport:
        return open_transport(connection, recognises)

    return ReopeningTransport(transport, reopen, silent_s=silent_s)


class ReopeningTransport(Transport):
    """A transport that raises once when it breaks, is quiet while it is broken, and comes back.

    Parameters
    ----------
    transport
        The open connection.
    reopen
        Opens it anew; raises `LinkError` while that cannot be done. Called in another thread.
    silent_s
        [s] A peer that was heard and is silent for so long is taken for gone.
    clock
        [s] Monotonic time.
    """

    def __init__(
        self,
        transport: Transport,
        reopen: Callable[[], Transport],
        *,
        silent_s: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.reopened = 0
        """[-] How often it has come back."""
        self._transport: Transport | None = transport
        self._reopen = reopen
        self._silent_s = silent_s
        self._clock = clock
        self._heard_s = math.inf
        self._closing = threading.Event()
        self._mender: threading.Thread | None = None

    @property
    def is_open(self) -> bool:
        """Whether there is a connection now."""
        return self._transport is not None

    def fileno(self) -> int:
        """Give the descriptor to poll; -1 while there is none."""
        transport = self._transport
        return -1 if transport is None else transport.fileno()

    def receive(self) -> bytes:
        """Give what has come; see `Transport.receive`. Raises at the break, not after it."""
        transport = self._transport
        if transport is None:
            return b""
        try:
            data = transport.receive()
            self._listen(data)
        except LinkError:
            self._mend(transport)
            raise
        return data

    def send(self, data: bytes) -> None:
        """Send bytes; see `Transport.send`. Raises at the break, not after it."""
        transport = self._transport
        if transport is None:
            return
        try:
            transport.send(data)
        except LinkError:
            self._mend(transport)
            raise

    def close(self) -> None:
        """Close the connection, and try no more."""
        self._closing.set()
        if self._mender is not None:
            self._mender.join()
        if self._transport is not None:
            self._transport.close()

    def _listen(self, data: bytes) -> None:
        now_s = self._clock()
        if data:
            self._heard_s = now_s
        elif now_s - self._heard_s > self._silent_s:
            raise LinkError(f"nothing came for {self._silent_s:g} s")

    def _mend(self, broken: Transport) -> None:
        self._transport, self._heard_s = None, math.inf
        self._mender = threading.Thread(
            target=self._work, args=(broken,), name="reopen", daemon=True
        )
        self._mender.start()

    def _work(self, broken: Transport) -> None:
        with suppress(OSError):
            broken.close()  # here, because a serial line may wait for what it has not sent
        wait_s = FIRST_S
        while not self._closing.wait(wait_s):
            wait_s = min(2.0 * wait_s, LONGEST_S)
            with suppress(LinkError):
                opened = self._reopen()
                self.reopened += 1
                self._transport = opened
                return

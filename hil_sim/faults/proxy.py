"""A TCP connection with somebody in the middle who can cut it: Zenoh's, to the sensors."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

from twinscrew.hil_sim.drivers.processes import LOOPBACK

_READ = 1 << 18


class Proxy:
    """Passes on what comes to a port of its own; threads of its own do the work."""

    def __init__(self, target_port: int) -> None:
        """Listen on any free port of this machine, for `target_port`."""
        self._target = (LOOPBACK, target_port)
        self._flows = threading.Event()
        self._flows.set()
        self._lock = threading.Lock()
        self._open: list[socket.socket] = []
        self._workers: list[threading.Thread] = []
        self._listener = self._listen(0)
        self.port = int(self._listener.getsockname()[1])
        """Where to connect instead of the target's port."""

    def cut(self, *, silently: bool) -> None:
        """Cut the connection: silently nothing passes; else it is closed, and a new one refused."""
        if silently:
            self._flows.clear()
        else:
            self._close_all()

    def mend(self) -> None:
        """Let everything pass again."""
        if self._flows.is_set():
            self._listener = self._listen(self.port)
        self._flows.set()

    def close(self) -> None:
        """Stop."""
        self._flows.set()
        self._close_all()

    def _work(self, do: Callable[..., None], *ends: socket.socket) -> None:
        worker = threading.Thread(target=do, args=ends, daemon=True)
        with self._lock:
            self._workers.append(worker)
        worker.start()

    def _listen(self, port: int) -> socket.socket:
        listener = socket.create_server((LOOPBACK, port))
        self._work(self._accept, listener)
        return listener

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):  # the listener was closed
            while True:
                near, _ = listener.accept()
                self._join(near)

    def _join(self, near: socket.socket) -> None:
        try:
            far = socket.create_connection(self._target)
        except OSError:
            near.close()
            return
        with self._lock:
            self._open += [near, far]
        for one, other in ((near, far), (far, near)):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._work(self._pump, one, other)

    def _pump(self, source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(_READ):
                self._flows.wait()
                sink.sendall(data)
        for end in (source, sink):
            _shut(end)

    def _close_all(self) -> None:
        with self._lock:
            ends, self._open = self._open, []
            workers, self._workers = self._workers, []
        for end in (self._listener, *ends):
            _shut(end)
        for worker in workers:
            worker.join()
        for end in (self._listener, *ends):
            end.close()


def _shut(end: socket.socket) -> None:
    """Wake whoever waits for a socket: closing alone does not."""
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)

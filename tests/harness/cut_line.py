"""A simulated autopilot in real time, behind a TCP server or a serial line that can be cut."""

from __future__ import annotations

import os
import pty
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings

STEP_S = 0.02
READ = 65_536


class TcpServer:
    """A server on one port, which can be stopped and started again."""

    def __init__(self) -> None:
        self._server: socket.socket | None = None
        self._peer: socket.socket | None = None
        self._port = 0
        self.mend()
        self.connection = f"tcp:127.0.0.1:{self._port}"

    def mend(self) -> None:
        self._server = socket.create_server(("127.0.0.1", self._port))
        self._server.setblocking(False)
        self._port = self._server.getsockname()[1]

    def cut(self) -> None:
        server, peer, self._server, self._peer = self._server, self._peer, None, None
        for end in (server, peer):
            if end is not None:
                end.close()

    def exchange(self, data: bytes) -> bytes:
        if self._server is not None and self._peer is None:
            with suppress(BlockingIOError):
                self._peer, _ = self._server.accept()
                self._peer.setblocking(False)
        if self._peer is None:
            return b""
        try:
            self._peer.send(data)
            return self._peer.recv(READ)
        except BlockingIOError:
            return b""


class SerialAdapter:
    """A serial adapter that can be pulled and put back: a pseudo-terminal behind a link."""

    def __init__(self, folder: Path) -> None:
        self._link = folder / "ttyACM0"
        self.connection = f"serial:{self._link}:57600"
        self._ends: tuple[int, int] | None = None
        self.mend()

    def mend(self) -> None:
        self._ends = pty.openpty()
        self._link.symlink_to(os.ttyname(self._ends[1]))

    def cut(self) -> None:
        ends, self._ends = self._ends, None
        self._link.unlink(missing_ok=True)
        for end in ends or ():
            os.close(end)

    @property
    def master(self) -> int:
        """The far end's descriptor."""
        assert self._ends is not None
        return self._ends[0]

    def exchange(self, data: bytes) -> bytes:
        if self._ends is None:
            return b""
        master = self.master
        if select.select([], [master], [], 0)[1]:
            os.write(master, data)
        ready, _, _ = select.select([master], [], [], 0)
        return os.read(master, READ) if ready else b""


class AutopilotOnALine:
    """An autopilot that lives in a thread of its own; `within` does things between its steps."""

    def __init__(self, line: TcpServer | SerialAdapter, **settings: object) -> None:
        self.line = line
        self.autopilot = RoverAutopilot(RoverAutopilotSettings(**settings), 1)
        self.heard: list[bytes] = []
        """What the runtime has sent, as it came."""
        self._wishes: list[Callable[[], None]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    @property
    def moves(self) -> bool:
        return bool(self.autopilot.thrust_command_N().any())

    def within(self, wish: Callable[[], None]) -> None:
        """Have something done by the autopilot's thread, and wait for it."""
        done = threading.Event()
        self._wishes += [wish, done.set]
        assert done.wait(60)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.line.cut()

    def _work(self) -> None:
        begin_s = time.monotonic()
        while not self._stop.wait(STEP_S):
            while self._wishes:
                self._wishes.pop(0)()
            now_s = time.monotonic() - begin_s
            with suppress(OSError):
                came = self.line.exchange(self.autopilot.step(now_s))
                self.heard.append(came)
                self.autopilot.receive(came, now_s)

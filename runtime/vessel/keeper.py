"""A process beside the runtime's that stops thrusters commanded by topic when the runtime does not.

A simulator or a motor node keeps the last thrust for ever. So the runtime tells this process with
every command that it lives. When that stops (killed, stopped, or hanging), or the runtime ends,
this process sends zero in its place: again and again, until the runtime is back, or for a while
after its end.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time
from contextlib import suppress
from typing import Final

import msgspec

from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages import cdr

SILENT_S: Final = 0.3
"""[s] A runtime that commands 20 times a second and has said nothing for so long is held up."""
EVERY_S: Final = 0.05
"""[s] Between two zeros."""
AFTERWARDS_S: Final = 2.0
"""[s] Zeros go on for so long after the runtime's end, for who listens late or lost some."""
LOOK_EVERY_S: Final = 1.0
"""[s] How often to look whether the keeper lives."""


class _Watch(msgspec.Struct, frozen=True):
    """What the keeper is told when it starts."""

    bus: ZenohSettings
    name: str


class Keeper:
    """The runtime's end: starts the process, and tells it that the runtime lives."""

    def __init__(self, bus: ZenohSettings, name: str) -> None:
        # It hears nobody, and announces nothing: the thrusters' publisher is the runtime.
        quiet = msgspec.structs.replace(bus, node="", listen=())
        self._words = msgspec.json.encode(_Watch(quiet, name)) + b"\n"
        self._looked_s = time.monotonic()
        self.pid = self._started()
        """The process's id."""

    def alive(self, now_s: float) -> str | None:
        """Tell it that the runtime lives; give a word if it had ended and was started again."""
        with suppress(OSError):  # full: it has enough to read; closed: it is started again below
            os.write(self._pipe, b".")
        if now_s - self._looked_s < LOOK_EVERY_S:
            return None
        self._looked_s = now_s
        ended, status = os.waitpid(self.pid, os.WNOHANG)
        if not ended:
            return None
        os.close(self._pipe)
        self.pid = self._started()
        return f"it had ended with status {os.waitstatus_to_exitcode(status)}"

    def close(self) -> None:
        """Let it see the runtime's end; it goes on by itself for a while."""
        os.close(self._pipe)

    def _started(self) -> int:
        """Start it, and give its id. It outlives us, so that nobody waits for its end."""
        theirs, self._pipe = os.pipe()
        os.set_blocking(self._pipe, False)
        os.write(self._pipe, self._words)
        words = [sys.executable, "-m", __name__]
        as_input = (os.POSIX_SPAWN_DUP2, theirs, 0)
        try:
            return os.posix_spawn(sys.executable, words, os.environ, file_actions=[as_input])
        finally:
            os.close(theirs)


def main() -> None:
    """Be the other process, until a while after the runtime's end."""
    # What ends the runtime must not end this: the end of its input does.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    line = b""
    while not line.endswith(b"\n"):
        byte = os.read(0, 1)
        if not byte:
            return  # it ended before it could command anything
        line += byte
    watch = msgspec.json.decode(line, type=_Watch)
    try:
        bus = ZenohBus(watch.bus, watch.name)
    except BusError as error:
        print(f"{watch.name}: keeper: {error}", file=sys.stderr)
        raise SystemExit(1) from None
    zero, heard_s, ended_s = cdr.encode_thrust(0.0), time.monotonic(), None
    while ended_s is None or time.monotonic() - ended_s < AFTERWARDS_S:
        now_s = time.monotonic()
        if ended_s is None and select.select([0], [], [], EVERY_S)[0]:
            if os.read(0, 4096):
                heard_s = time.monotonic()
                continue
            ended_s = time.monotonic()
        elif ended_s is not None:
            time.sleep(EVERY_S)
        if ended_s is not None or now_s - heard_s > SILENT_S:
            for topic in ("thrust_left", "thrust_right"):
                with suppress(BusError):
                    bus.publish(topic, zero)
    bus.close()


if __name__ == "__main__":
    main()

"""What a program prints: it may have nowhere to go, and no way to be written."""

from __future__ import annotations

import contextlib
import io
import os
import sys


def bear_any_text() -> None:
    """Print `?` for what the terminal's encoding has no letter for."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def flush() -> None:
    """Write what is still to be printed: at the interpreter's end a failure would have no answer.

    Raises
    ------
    OSError
        The reader has gone, or the disk is full. Nothing is printed to there any more.
    """
    if sys.stdout is None:  # closed by who started us
        return
    try:
        sys.stdout.flush()
    except OSError:
        give_up()
        raise


def give_up() -> None:
    """Let standard output go nowhere."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)

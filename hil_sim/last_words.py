"""What a process that should be running said before it ended."""

from __future__ import annotations

import subprocess

from twinscrew.runtime.errors import LinkError

TAIL = 400
"""[bytes] Of its log to repeat."""


def ended(who: str, process: subprocess.Popen[bytes], log: bytes) -> LinkError:
    """Give the error that names a process which has ended, its status, and the end of its log."""
    words = log[-TAIL:].decode(errors="replace").strip()
    return LinkError(f"{who} ended with status {process.returncode}: {words}")

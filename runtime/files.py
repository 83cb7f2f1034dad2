"""Reads the files that decide what a runtime does; where they must be approved, only as approved.

Between a check of a file and its use somebody may change it. So an approved file is read once: what
was read is compared with the manifest, kept, and given to whoever reads the file after that. Files
are written whole or not at all.
"""

from __future__ import annotations

import os
import platform
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from twinscrew.runtime.errors import ConfigError

_approved: Mapping[Path, bytes] | None = None


MOST_BYTES = 500_000_000
"""[B] Of a file that decides anything: a large network has 10 MB."""


def read_file(path: Path, most: int = MOST_BYTES) -> bytes:
    """Read a file of a runtime's configuration, or give what was approved of it.

    Parameters
    ----------
    most
        [B] A larger file is refused, unread beyond this: a device may never end.

    Raises
    ------
    OSError
        It cannot be read.
    ConfigError
        It is too large; or only approved files may be read, and this is none of them.
    """
    if _approved is None:
        with path.open("rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise ConfigError(f"has more than {most / 1e6:g} MB", file=path)
        return content
    approved = _approved.get(path.resolve())
    if approved is None:
        raise ConfigError("is read, but nobody approved it", file=path)
    return approved


@contextmanager
def only_approved(contents: Mapping[Path, bytes] | None) -> Iterator[None]:
    """Let `read_file` give these contents, by absolute path, and nothing else; None: anything."""
    global _approved
    before, _approved = _approved, contents
    try:
        yield
    finally:
        _approved = before


def replace_file(file: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write beside a file, and let that take its place: it is there whole, or as it was before.

    Parameters
    ----------
    write
        Takes the open file, and writes the new contents.

    Raises
    ------
    OSError
        It cannot be written.
    """
    part = file.with_name(f".{file.name}.part")
    try:
        with part.open("wb") as out:
            write(out)
            out.flush()
            os.fsync(out.fileno())
        part.replace(file)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def processor() -> str:
    """Give the processor's name, as the system calls it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.machine()


# -- Who may read or change a file: secrets are their owner's, what is trusted is not everyone's.
#
# Only the file itself is looked at: whoever may write to its folder can put another in its place.


def require_private(path: Path) -> None:
    """Check that nobody but its owner may do anything with a file that holds a secret.

    Raises
    ------
    ConfigError
        It cannot be found, or others may use it.
    """
    mode = _mode(path)
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ConfigError(
            f"others may use this key (mode {mode:04o}); make it yours alone: chmod 600", file=path
        )


def require_unwritable(path: Path) -> None:
    """Check that nobody but its owner may change a file that is trusted.

    Raises
    ------
    ConfigError
        It cannot be found, or others may change it.
    """
    mode = _mode(path)
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise ConfigError(
            f"others may change this file (mode {mode:04o}), so it cannot be trusted: chmod go-w",
            file=path,
        )


def _mode(path: Path) -> int:
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=path) from error

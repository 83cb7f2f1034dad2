"""Reads the files that decide what a runtime does; where they must be approved, only as approved.

Between a check of a file and its use somebody may change it. So an approved file is read once: what
was read is compared with the manifest, kept, and given to whoever reads the file after that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from twinscrew.runtime.errors import ConfigError

_approved: Mapping[Path, bytes] | None = None


def read_file(path: Path) -> bytes:
    """Read a file of a runtime's configuration, or give what was approved of it.

    Raises
    ------
    OSError
        It cannot be read.
    ConfigError
        Only approved files may be read, and this is none of them.
    """
    if _approved is None:
        return path.read_bytes()
    content = _approved.get(path.resolve())
    if content is None:
        raise ConfigError("is read, but nobody approved it", file=path)
    return content


@contextmanager
def only_approved(contents: Mapping[Path, bytes] | None) -> Iterator[None]:
    """Let `read_file` give these contents, by absolute path, and nothing else; None: anything."""
    global _approved
    before, _approved = _approved, contents
    try:
        yield
    finally:
        _approved = before

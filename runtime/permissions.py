"""Who may read or change a file: secrets are their owner's, what is trusted is not everyone's.

Only the file itself is looked at: whoever may write to its folder can put another in its place.
"""

from __future__ import annotations

import stat
from pathlib import Path

from twinscrew.runtime.errors import ConfigError


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

"""The one error hierarchy: refuse at the dock, degrade at sea.

Everything raised on purpose is a `TwinscrewError`; the command line turns it into one line on
standard error and exit status 2. In the control loop these errors become health events instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final


class TwinscrewError(Exception):
    """Anything that twinscrew refuses, in words a user can act on."""


class ConfigError(TwinscrewError):
    """A configuration that cannot be used; says which file, key and value, and what is allowed."""

    def __init__(
        self, message: str, *, file: Path | str | None = None, key: str | None = None
    ) -> None:
        where = ": ".join(str(part) for part in (file, key) if part is not None)
        super().__init__(f"{where}: {message}" if where else message)
        self.file = file
        self.key = key


class MessageError(TwinscrewError):
    """Bytes from outside that are not the message they should be."""


class PolicyError(TwinscrewError):
    """A policy file that cannot be trusted, or a policy that answered nonsense."""


class LinkError(TwinscrewError):
    """The autopilot cannot be reached, or does not do what it is told."""


class BusError(TwinscrewError):
    """The message bus cannot be opened or used."""


class RecordingError(TwinscrewError):
    """A recording that cannot be written, read or replayed."""


NOT_THE_FORMAT: Final = (ValueError, RecursionError)
"""What reading others' JSON or TOML raises: it is no UTF-8, not that, or nested too deep."""


def one_of(value: object, allowed: Iterable[object]) -> str:
    """Words for a refused choice: the value, and every valid choice."""
    choices = ", ".join(repr(choice) for choice in allowed)
    return f"{value!r} is not one of {choices}"

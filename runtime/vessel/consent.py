"""Consent to arm: an operator's word, given by a command, used up by the next start.

`arm = true` in a configuration file says what a start may do, and stays there. A supervisor that
starts a runtime again says nothing at all: a pilot may have disarmed the boat meanwhile, and the
new process cannot know. So `run` asks the autopilot to arm only if somebody has given consent since
the computer started, not long ago, and it uses this consent up: it deletes the file before anything
else. What cannot be deleted is no consent, because it would count again (docs/decisions/0007).
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Final

from twinscrew.runtime.errors import ConfigError

LASTS_S: Final = 600.0
"""[s] Consent that was given longer ago is none: who gave it has gone away."""
SUFFIX: Final = ".arm"
_FIRST: Final = "twinscrew: consent to arm"
_LONGEST: Final = 4096
"""[B] Of a file: no more is read."""


def place_of(config_file: Path, setting: str) -> Path:
    """Give where consent lies: as `autopilot.consent_file` says, or beside the configuration."""
    return Path(setting) if setting else config_file.with_name(config_file.name + SUFFIX)


def give(place: Path) -> None:
    """Give consent to the next start within `LASTS_S`.

    Raises
    ------
    ConfigError
        It cannot be written.
    """
    words = f"{_FIRST}\n{_boot()}\n{_uptime_s()!r}\n"
    beside = place.with_name(f"{place.name}.{os.getpid()}")
    try:
        beside.write_text(words, encoding="ascii")
        beside.replace(place)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise ConfigError(error.strerror or str(error), file=place) from error


def take(place: Path) -> str | None:
    """Use consent up. Gives None if there was one, or else says why there is none."""
    try:
        with place.open("rb") as file:
            content = file.read(_LONGEST)
        place.unlink()
    except FileNotFoundError:
        return f"nobody has given consent ({place})"
    except OSError as error:
        return f"{place} cannot be used up: {error.strerror or error}"
    return _why_not(content.decode("ascii", errors="replace").splitlines())


def _why_not(lines: list[str]) -> str | None:
    try:
        first, boot, given = lines
        age_s = _uptime_s() - float(given)
    except ValueError:
        return "what lay there is no consent"
    if first != _FIRST:
        return "what lay there is no consent"
    if boot != _boot():
        return "the consent is of before the computer was restarted"
    if not 0.0 <= age_s <= LASTS_S:
        return f"the consent is {age_s:.0f} s old, more than {LASTS_S:g} s"
    return None


def _boot() -> str:
    """Tell this start of the computer from all others."""
    return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()


def _uptime_s() -> float:
    """[s] Since the computer started, time asleep included: nobody sets this clock."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)

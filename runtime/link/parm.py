"""Parameter files as ground stations write them: a name and a value a line, # for comments."""

from __future__ import annotations

import math
import re
from pathlib import Path

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import read_file

_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
"""MAVLink names parameters in up to 16 characters."""


def read_parm(path: Path) -> dict[str, float]:
    """Read a parameter file; names are in the file's order.

    Raises
    ------
    ConfigError
        The file cannot be read, or a line is not a name and a finite number.
    """
    try:
        lines = read_file(path).decode("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(str(error), file=path) from error
    values: dict[str, float] = {}
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            name, value = _parse(words, path, number)
            if name in values:
                raise ConfigError(f"line {number}: given twice", file=path, key=name)
            values[name] = value
    return values


def _parse(words: list[str], path: Path, number: int) -> tuple[str, float]:
    if len(words) != 2 or not _NAME.fullmatch(words[0]):
        raise ConfigError(f"line {number}: not a name and a number: {' '.join(words)}", file=path)
    try:
        value = float(words[1])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(f"line {number}: not a number: {words[1]}", file=path, key=words[0])
    return words[0], value

"""Markdown, as little as a report needs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

NOTHING = "-"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Give a table; a bar in a cell is escaped."""
    lines = [_line(header), _line(["---"] * len(header)), *(_line(row) for row in rows)]
    return "\n".join(lines)


def share(part: int, whole: int) -> str:
    """Give a share with its count, as "94 % (94/100)"."""
    return f"{100 * part / whole:.0f} % ({part}/{whole})" if whole else NOTHING


def number(value: float | None, digits: int = 2) -> str:
    """Give a number, or a dash where there is none."""
    return NOTHING if value is None or math.isnan(value) else f"{value:.{digits}f}"


def interval(low: float, high: float, digits: int = 2) -> str:
    """Give an interval, as "17.10 .. 17.94"."""
    return NOTHING if math.isnan(low) else f"{low:.{digits}f} .. {high:.{digits}f}"


def p_value(value: float) -> str:
    """Give a p value as people read it."""
    return "< 0.001" if value < 0.001 else f"{value:.3f}"


def _line(cells: Sequence[str]) -> str:
    escaped = (cell.replace("|", "\\|") for cell in cells)
    return f"| {' | '.join(escaped)} |"

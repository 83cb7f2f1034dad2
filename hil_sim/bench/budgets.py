"""What the figures may be: `config/budgets.toml`, laid out as the figures are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import CONFIG_DIR, read_toml

FILE = CONFIG_DIR / "budgets.toml"
LIMITS = ("at_most", "at_least")
STAGE_FIGURES = ("p50_ms", "p99_ms")
"""What every stage needs a budget of."""

Budgets = dict[str, dict[str, Any]]
"""The limits, by "at_most" and "at_least", in nested tables."""


def load_budgets(file: Path = FILE) -> Budgets:
    """Read the budgets.

    Raises
    ------
    ConfigError
        No such file, or one that holds anything but limits.
    """
    budgets = read_toml(file)
    for name, table in budgets.items():
        if name not in LIMITS or not isinstance(table, dict):
            raise ConfigError(f"must be a table {' or '.join(LIMITS)}", file=file, key=name)
        for path, limit in _leaves(table):
            if isinstance(limit, bool) or not isinstance(limit, int | float):
                raise ConfigError(f"{limit!r} is no number", file=file, key=f"{name}.{path}")
    return budgets


def require(budgets: Budgets, densities: tuple[str, ...], stages: tuple[str, ...]) -> None:
    """Refuse a stage that has no budget.

    Raises
    ------
    ConfigError
        It names the stage.
    """
    given = {path for path, _ in _leaves(budgets.get("at_most", {}))}
    for density in densities:
        for stage in stages:
            for figure in STAGE_FIGURES:
                path = f"latency.{density}.{stage}.{figure}"
                if path not in given:
                    raise ConfigError("this stage has no budget", file=FILE, key=f"at_most.{path}")


def compared(results: dict[str, Any], budgets: Budgets) -> dict[str, dict[str, Any]]:
    """Put figures beside their budgets: {path: {"figure", "budget", "kept"}}, those measured."""
    figures = dict(_leaves(results))
    found: dict[str, dict[str, Any]] = {}
    for limit in LIMITS:
        for path, budget in _leaves(budgets.get(limit, {})):
            if path in figures:
                figure = figures[path]
                kept = figure <= budget if limit == "at_most" else figure >= budget
                found[path] = {"figure": figure, "budget": budget, "kept": bool(kept)}
    return found


def _leaves(table: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Give what is in nested tables, by names joined with dots."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value

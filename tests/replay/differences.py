"""Where two runs' decisions differ, field by field."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import HealthEvent

TOLERANCE = {"thrust": 0.1, "thrust_rate": 0.2, "ego": 0.1}
"""[N, N/s] What another machine's rounding may make of thrusts; `ego` holds the thrust too."""
OTHER = 1e-4
"""[m, m/s, rad, s] The same of everything else."""


class Difference(NamedTuple):
    """One field in which two decisions differ."""

    decision: int
    field: str
    expected: object
    found: object

    def __str__(self) -> str:
        return f"decision {self.decision}: {self.field}: {self.expected} -> {self.found}"


def summary(found: Sequence[Difference]) -> Iterator[str]:
    """Say of each field where it first differs, how often, and by how much at most."""
    fields: dict[str, list[Difference]] = {}
    for difference in found:
        fields.setdefault(difference.field.partition("[")[0], []).append(difference)
    for name, group in fields.items():
        decisions = len({difference.decision for difference in group})
        greatest = max(_size(difference) for difference in group)
        size = f", by {greatest:.3g} at most" if greatest else ""
        yield f"{name}: in {decisions} decisions{size}; first {group[0]}"


def _size(difference: Difference) -> float:
    """Give by how much numbers differ; 0 for anything else."""
    old, new = difference.expected, difference.found
    if isinstance(old, float) and isinstance(new, float):
        return abs(new - old)
    return 0.0


def differences(
    expected: Sequence[bytes], found: Sequence[bytes], *, exact: bool
) -> Iterator[Difference]:
    """Compare encoded decisions, in order: bit for bit, or as far as another machine can."""
    if len(expected) != len(found):
        yield Difference(-1, "number of decisions", len(expected), len(found))
    for index, (old, new) in enumerate(zip(expected, found, strict=False)):
        if old != new:
            pair = cdr.decode_decision(old), cdr.decode_decision(new)
            for name, before, after in _compare("", *pair, exact=exact):
                yield Difference(index, name, before, after)


def _compare(name: str, old: Any, new: Any, *, exact: bool) -> Iterator[tuple[str, object, object]]:
    if is_dataclass(old) and type(old) is type(new):
        for field in fields(old):
            values = getattr(old, field.name), getattr(new, field.name)
            yield from _compare(f"{name}.{field.name}".lstrip("."), *values, exact=exact)
    elif isinstance(old, tuple) and isinstance(new, tuple) and len(old) == len(new):
        for index, values in enumerate(zip(old, new, strict=True)):
            yield from _compare(f"{name}[{index}]", *values, exact=exact)
    elif isinstance(old, np.ndarray) and isinstance(new, np.ndarray) and old.shape == new.shape:
        for where in zip(*np.nonzero(_unlike(name, old, new, exact=exact)), strict=True):
            place = ", ".join(str(index) for index in where)
            yield f"{name}[{place}]", old[where].item(), new[where].item()
    elif isinstance(old, np.ndarray) or isinstance(new, np.ndarray):
        yield name, _shape(old), _shape(new)
    elif old != new:
        yield name, _plain(old), _plain(new)


def _unlike(name: str, old: np.ndarray, new: np.ndarray, *, exact: bool) -> np.ndarray:
    if exact or old.dtype.kind != "f":
        return np.not_equal(old, new) & ~((old != old) & (new != new))
    tolerance = TOLERANCE.get(name.rpartition(".")[2], OTHER)
    return ~np.isclose(old, new, rtol=1e-5, atol=tolerance, equal_nan=True)


def _shape(value: object) -> str:
    return f"{value.shape} array" if isinstance(value, np.ndarray) else repr(value)


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, HealthEvent):
        return f"{value.name} ({value.detail})" if value.detail else value.name
    return value.value if isinstance(value, Enum) else value

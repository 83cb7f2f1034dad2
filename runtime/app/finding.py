"""One line of the doctor's report."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """How a check came out."""

    OK = "OK"
    WARN = "WARN"
    FAIL = "FAIL"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the doctor's report."""

    what: str
    verdict: Verdict
    found: str
    advice: str = ""
    """What to do about it; empty if all is well."""


def ok(what: str, found: str) -> Finding:
    """Say that all is well."""
    return Finding(what, Verdict.OK, found)


def warn(what: str, found: str, advice: str) -> Finding:
    """Say that it works, but not as well as it should."""
    return Finding(what, Verdict.WARN, found, advice)


def fail(what: str, found: str, advice: str) -> Finding:
    """Say that a boat cannot sail like this."""
    return Finding(what, Verdict.FAIL, found, advice)

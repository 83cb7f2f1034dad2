"""The autopilot's parameters: read, compared with config/autopilot/ardurover.parm, written."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import read_file
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.settings import CONFIG_DIR

# -- Parameter files as ground stations write them: a name and a value a line, # for comments.


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


# -- The autopilot parameters that the link depends on: which are wrong, and writing them.

SHIPPED = CONFIG_DIR / "autopilot" / "ardurover.parm"
"""The parameters and their values."""
GCS_ID = "SYSID_MYGCS"
"""Whose overrides count: must be the system id that we speak as."""
OTHER_NAMES = {GCS_ID: "MAV_GCS_SYSID"}
"""Names that newer firmware (4.7) gave to old parameters."""
SAFETY = ("FS_THR_ENABLE", "FS_ACTION", "RC_OVERRIDE_TIME", GCS_ID)
"""Parameters on which safety rests: what stops the propellers when we stop, and who may drive. The
link neither drives nor arms while one of them is wrong or unread."""
NOT_SHAPING = frozenset({*SAFETY, "FS_TIMEOUT", "FS_THR_VALUE", "ARMING_RUDDER"})
"""Parameters that do not change what the outputs make of the channels; all others do."""
AGAIN_S = 2.0
"""[s] A parameter that is wrong is read again after this long: somebody may have put it right."""
RETRY_S = 0.5
"""[s] Ask again after this long without an answer."""
TRIES = 10
"""[-] Then the parameter is taken as missing (or asked for by its newer name)."""
AT_ONCE = 4
"""[-] Questions on their way at a time: a slow serial line must not fill up."""
_FLOAT_EPSILON = 1e-6
"""[-] Relative: parameters travel as 32-bit floats."""


def expected_parameters(system_id: int) -> dict[str, float]:
    """Give the names and values that a boat of this system id must have."""
    return read_parm(SHIPPED) | {GCS_ID: float(system_id)}


@dataclass(frozen=True, slots=True)
class ParameterState:
    """What is known of one parameter."""

    name: str
    """As the autopilot calls it."""
    wanted: float
    found: float | None
    """None if it was not answered."""
    missing: bool
    """Whether the autopilot does not know it."""
    before: float | None
    """What it was before we wrote it; None if we did not."""

    @property
    def right(self) -> bool:
        """Whether it is what it must be."""
        return self.found is not None and _same(self.found, self.wanted)


@dataclass(slots=True)
class _Question:
    name: str
    expected: float
    asked_as: str
    tries: int = 0
    next_s: float = 0.0
    value: float | None = None
    answered: bool = False
    missing: bool = False
    again_s: float = 0.0
    writes: int = 0
    before: float | None = None
    told: bool = False

    @property
    def open(self) -> bool:
        return not (self.answered or self.missing)

    @property
    def wrong(self) -> bool:
        return self.missing or (self.value is not None and not _same(self.value, self.expected))

    @property
    def unsafe(self) -> bool:
        return self.wrong or self.value is None


class ParameterCheck:
    """Reads the parameters, a few at a time, and compares.

    Parameters
    ----------
    expected
        Names and the values that they must have.
    write
        Write what is wrong (PARAM_SET), and believe it when the autopilot repeats it.
    accepted
        Names of `SAFETY` that the configuration accepts whatever they are.
    """

    def __init__(
        self,
        expected: Mapping[str, float],
        *,
        write: bool = False,
        accepted: Collection[str] = (),
    ) -> None:
        names = sorted(expected, key=lambda name: name not in SAFETY)  # those of safety first
        self._questions = {name: _Question(name, expected[name], name) for name in names}
        self._order = tuple(expected)
        known_as = {other: name for name, other in OTHER_NAMES.items()}
        excused = {known_as.get(name, name) for name in accepted}
        self._safety = [
            q for q in self._questions.values() if q.name in SAFETY and q.name not in excused
        ]
        self._write = write
        self._judge()

    @property
    def done(self) -> bool:
        """Whether every parameter was answered or given up."""
        return not self._open

    def has(self, *names: str) -> bool:
        """Tell whether these parameters are known to be what they must be."""
        found = [self._questions.get(name) for name in names]
        return all(q is not None and not q.open and not q.wrong for q in found)

    def read_again(self) -> None:
        """Read every parameter again; what was read stays known until the new answer."""
        for q in self._questions.values():
            q.missing, q.tries, q.next_s, q.answered = False, 0, 0.0, False
        self._judge()

    @property
    def values(self) -> dict[str, float]:
        """What is known so far."""
        return {q.name: q.value for q in self._questions.values() if q.value is not None}

    @property
    def states(self) -> tuple[ParameterState, ...]:
        """What is known of every parameter, in the order of the list."""
        return tuple(
            ParameterState(q.asked_as, q.expected, q.value, q.missing, q.before)
            for q in (self._questions[name] for name in self._order)
        )

    def take_written(self) -> list[str]:
        """Give words about each parameter that was put right since the last call."""
        words = []
        for q in self._questions.values():
            if q.before is not None and not q.wrong and not q.told:
                q.told = True
                words.append(f"{q.asked_as} was {q.before:g}, is {q.expected:g} now")
        return words

    def ask(self, target: int, now_s: float) -> list[Message]:
        """Give the requests to send now."""
        messages = []
        for question in self._open[:AT_ONCE]:
            if now_s < question.next_s:
                continue
            if question.tries >= TRIES and not _try_other_name(question):
                self._judge()
                continue
            question.tries += 1
            question.next_s = now_s + RETRY_S
            messages.append(_read(target, question.asked_as))
        if not self._open:
            messages += self._ask_after_the_wrong(target, now_s)
        return messages

    def heard(self, name: str, value: float, target: int) -> list[Message]:
        """Take a PARAM_VALUE; gives the PARAM_SET that mends it, if that is wanted."""
        asked = [q for q in self._questions.values() if q.asked_as == name]
        mend = []
        for question in asked:
            question.value, question.missing, question.answered = value, False, True
            if self._write and question.wrong and question.writes < TRIES:
                if question.before is None:
                    question.before = value
                question.writes += 1
                mend.append(_write(target, name, question.expected))
        if asked:
            self._judge()
        return mend

    def _ask_after_the_wrong(self, target: int, now_s: float) -> list[Message]:
        due = [q for q in self._questions.values() if q.wrong and now_s >= q.again_s][:AT_ONCE]
        for question in due:
            question.again_s = now_s + AGAIN_S
            other = OTHER_NAMES.get(question.name)
            if question.missing and other is not None:  # whichever name this firmware knows
                question.asked_as = other if question.asked_as == question.name else question.name
        return [_read(target, question.asked_as) for question in due]

    def _judge(self) -> None:
        questions = [self._questions[name] for name in self._order]
        self._open = [q for q in self._questions.values() if q.open]
        self.wrong: tuple[str, ...] = tuple(_words(q) for q in questions if q.wrong)
        """Words about each parameter known to be wrong: what it is, what it must be."""
        self.shaping: tuple[str, ...] = tuple(
            _words(q) for q in questions if q.wrong and q.name not in NOT_SHAPING
        )
        """Those of them that change what the outputs make of the channels."""
        self.unsafe: tuple[str, ...] = tuple(_words(q) for q in self._safety if q.unsafe)
        """Words about each parameter of safety that is wrong, or not read yet, and not accepted."""


def _try_other_name(question: _Question) -> bool:
    other = OTHER_NAMES.get(question.name)
    if other is None or question.asked_as == other:
        question.missing = True
        return False
    question.asked_as, question.tries = other, 0
    return True


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= _FLOAT_EPSILON * max(1.0, abs(b))


def _words(question: _Question) -> str:
    if question.value is None and not question.missing:
        return f"{question.name} is not read yet, must be {question.expected:g}"
    if question.missing:
        return f"{question.name} is missing, must be {question.expected:g}"
    return f"{question.asked_as} is {question.value:g}, must be {question.expected:g}"


def _read(target: int, name: str) -> Message:
    component = mavlink.MAV_COMP_ID_AUTOPILOT1
    return mavlink.MAVLink_param_request_read_message(target, component, name.encode("ascii"), -1)


def _write(target: int, name: str, value: float) -> Message:
    return mavlink.MAVLink_param_set_message(
        target,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
        name.encode("ascii"),
        value,
        mavlink.MAV_PARAM_TYPE_REAL32,
    )

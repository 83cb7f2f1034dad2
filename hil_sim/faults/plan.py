"""A file of faults: what happens when, to whom, and what the boat promises."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta, field
from msgspec.structs import replace

from twinscrew.hil_sim.faults.kinds import AT_ONCE, KINDS
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.settings import NonNegative, Positive, Settings, convert, load, shipped

EVERY_VESSEL = "all"


class Fault(Settings, frozen=True):
    """One thing that goes wrong."""

    at_s: NonNegative
    """[s] When, counted from the moment the vessels get their goals."""
    kind: str
    """What; a name of `KINDS`."""
    target: str
    """To what; each kind has its own."""
    for_s: NonNegative = 0.0
    """[s] How long."""
    vessel: str = EVERY_VESSEL
    """A vessel's name, as "wamv1"; or all."""
    parameters: dict[str, Any] = field(default_factory=dict)
    """What else there is to say; each kind has its own."""

    @property
    def end_s(self) -> float:
        """[s] When it is over, counted as `at_s`."""
        return self.at_s + self.for_s

    def settings(self) -> Settings:
        """Give the parameters, checked when the file was read."""
        return convert(self.parameters, KINDS[self.kind].parameters)


class Promise(Settings, frozen=True):
    """What the boat does about it, and within which time; what is not set is not promised."""

    fault: str
    """What goes wrong, in words."""
    reaction: str
    """What the boat does, in words."""
    neutral_s: Positive | None = None
    """[s] From the first fault's begin to propellers that stand still, and do until it ends."""
    neutral_until: Literal["first", "last"] = "first"
    """Which fault's end lets them turn again: the first's that is over, or the last's."""
    event: str | None = None
    """The health event that names it."""
    event_says: str = ""
    """Words that must be in the event's detail; empty: whatever it says."""
    event_s: Positive = 1.0
    """[s] Until that event."""
    event_from: Literal["fault", "thrust"] = "fault"
    """What its time counts from: the first fault's begin, or in it a thrust asked for in MANUAL
    without a break, where nothing else can show the fault."""
    state: str | None = None
    """The state that the boat is in before the first fault ends."""
    moves_again_s: Positive | None = None
    """[s] From the last fault's end to propellers that turn again."""
    steady: bool = False
    """From then on they stand still only where its own decisions ask for nothing."""
    sails_on: bool = False
    """The propellers never stand still."""
    rests: bool = False
    """The propellers stand still until the run ends: somebody else decides."""
    mode: str | None = None
    """The autopilot's mode when the run ends."""
    armed: bool | None = None
    """Whether the autopilot is armed then."""


class FaultPlan(Settings, frozen=True):
    """A file of faults."""

    fault: Annotated[tuple[Fault, ...], Meta(min_length=1)]
    promise: Promise | None = None
    autopilot: Literal["ardupilot", "thrust"] = "ardupilot"
    """How the boat is driven: by an autopilot, or by thrusters that take newtons by topic."""
    alone: bool = False
    """Whether the faults concern the whole machine, so that nothing else can be tried meanwhile."""
    settle_s: Positive = 4.0
    """[s] How long to look on after the last fault."""
    name: str = ""
    """The file's."""

    @property
    def end_s(self) -> float:
        """[s] When the last fault is over."""
        return max(fault.end_s for fault in self.fault)


def load_plan(name: str | Path, vessels: tuple[str, ...] = ()) -> FaultPlan:
    """Read a file of faults: the name of a shipped one (config/faults), or a path.

    Parameters
    ----------
    vessels
        The names that a fault may be for; empty if they are not known yet.

    Raises
    ------
    ConfigError
        It cannot be used; the error names the key and what is allowed.
    """
    path = shipped("faults", name)
    plan = load(path, FaultPlan)
    if plan.autopilot == "thrust" and vessels:
        words = "thrusters by topic are tried with `twinscrew faults --only` alone"
        raise ConfigError(words, file=path, key="autopilot")
    for number, fault in enumerate(plan.fault):
        _check(fault, f"fault[{number}]", path, vessels)
    return replace(plan, name=path.stem)


def _check(fault: Fault, key: str, path: Path, vessels: tuple[str, ...]) -> None:
    kind = KINDS.get(fault.kind)
    if kind is None:
        raise ConfigError(one_of(fault.kind, KINDS), file=path, key=f"{key}.kind")
    if fault.target not in kind.targets:
        words = f"of a {fault.kind}: {one_of(fault.target, kind.targets)}"
        raise ConfigError(words, file=path, key=f"{key}.target")
    if vessels and fault.vessel not in (*vessels, EVERY_VESSEL):
        words = one_of(fault.vessel, (*vessels, EVERY_VESSEL))
        raise ConfigError(words, file=path, key=f"{key}.vessel")
    if fault.kind not in AT_ONCE and fault.for_s == 0.0:
        raise ConfigError("must be > 0: how long it lasts", file=path, key=f"{key}.for_s")
    try:
        convert(fault.parameters, kind.parameters)
    except ConfigError as error:
        inner = ".".join(part for part in (key, "parameters", error.key or "") if part)
        words = str(error).removeprefix(f"{error.key}: ")
        raise ConfigError(words, file=path, key=inner) from error

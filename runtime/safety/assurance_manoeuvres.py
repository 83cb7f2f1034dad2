"""The ways out: what a vessel can do instead of what it was told, as laws of its two thrusts."""

from __future__ import annotations

from dataclasses import dataclass

from twinscrew.runtime._native import Law
from twinscrew.runtime.safety.assurance_vessel import Thrust
from twinscrew.runtime.safety.guard import ThrustLimits


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """A way out."""

    name: str
    law: Law


def ways_out(
    limits: ThrustLimits, *, brake_nspm: float, turn_n: float, to_starboard: bool
) -> tuple[Manoeuvre, ...]:
    """Give the manoeuvres in the order in which they are tried.

    Parameters
    ----------
    limits
        What a propeller can do.
    brake_nspm : float
        Thrust against each metre a second of surge [N s/m].
    turn_n : float
        By how much braking and turning differs between the propellers and the mean [N].
    to_starboard : bool
        Whether contact threatens on the starboard side.
    """
    ahead, astern = limits.max_n, limits.min_n
    away = (astern, ahead) if to_starboard else (ahead, astern)
    return (
        Manoeuvre("brake", braking(brake_nspm, 0.0, limits)),
        Manoeuvre("turn away", held(away)),
        Manoeuvre("brake and turn to starboard", braking(brake_nspm, turn_n, limits)),
        Manoeuvre("full astern", held((astern, astern))),
        Manoeuvre("full ahead", held((ahead, ahead))),
    )


def held(thrust: Thrust) -> Law:
    """Want the same all the time."""
    return Law(thrust)


def later(wait_s: float, command: Thrust, law: Law) -> Law:
    """Follow a command for a while [s], then the law."""
    return law.after(command, wait_s)


def braking(gain_nspm: float, turn_n: float, limits: ThrustLimits) -> Law:
    """Thrust against the speed until it is gone, and meanwhile turn to starboard by `turn_n`."""
    return Law((turn_n, -turn_n), gain_nspm, limits.min_n, limits.max_n)

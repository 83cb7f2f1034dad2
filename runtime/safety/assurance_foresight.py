"""Where a manoeuvre takes the vessel, and into contact with what.

The work is done by ``runtime/native/assurance.hpp``; this is its face. The equations of motion are
those of `policy.vessel_model` (Fossen (2021), chapters 3 and 6), for one vessel.
"""

from __future__ import annotations

from twinscrew.runtime import _native
from twinscrew.runtime._native import Law
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.safety.assurance_contact import NO_CONTACT, Circles, Contact
from twinscrew.runtime.safety.assurance_vessel import (
    STILL,
    AssuranceVessel,
    Motion,
    Push,
    Thrust,
)


class Foresight:
    """Predicts and judges. It keeps the kernel's memory: one serves one thread at a time."""

    def __init__(
        self,
        vessel: AssuranceVessel,
        *,
        steps: int,
        dt: float,
        slew_nps: float,
        margin_m: float,
        approach_per_s: float,
    ) -> None:
        """Prepare the kernel.

        Parameters
        ----------
        steps : int
            Number of time steps T of a prediction.
        dt : float
            Their length [s].
        slew_nps : float
            How fast each thrust may change [N/s].
        margin_m, approach_per_s : float
            Nearer than the margin [m], closing in is allowed at this times the gap [1/s].
        """
        self._kernel = _native.Foresight(
            vessel=(vessel.inertia, vessel.linear_drag, vessel.quadratic_drag),
            lever=vessel.lever_m,
            hull=vessel.hull,
            steps=steps,
            dt=dt,
            slew=slew_nps,
            margin=margin_m,
            approach=approach_per_s,
        )

    def acceleration(self, motion: Motion, thrust: Thrust) -> tuple[float, float, float]:
        """Give how surge, sway [m/s2] and yaw rate [rad/s2] change by thrust and water alone."""
        return self._kernel.acceleration(motion, thrust)

    def path(self, motion: Motion, thrust: Thrust, law: Law, push: Push = STILL) -> Float64:
        """Sail a manoeuvre: Euler steps of the velocity, trapezoids of the position.

        Parameters
        ----------
        motion, thrust
            How the vessel moves, and what its propellers give, now.
        law
            The manoeuvre.
        push
            What wind and current do, as long as the prediction lasts.

        Returns
        -------
        path : (T + 1, 3) float64
            x, y [m], heading [rad], from now on, in the vessel's present levelled frame.
        """
        return self._kernel.path(motion, thrust, law, push)

    def contact(self, path: Float64, circles: Circles) -> Contact:
        """Judge a path as `path` gives it, of any length.

        Nearer than the margin, closing in is allowed at `approach_per_s` times the gap that is
        left, so that a vessel may pass along an edge, or lie beside it, but not run into it; where
        they overlap, it has to leave as fast, as from 0.2 m at most. What comes later counts less,
        down to nothing at the track's horizon: until then there is time to decide again.
        """
        c = circles
        return _contact(self._kernel.contact(path, c.p_L, c.v_L, c.radius, c.horizon_s), c)

    def judge(
        self, motion: Motion, thrust: Thrust, law: Law, circles: Circles, push: Push = STILL
    ) -> Contact:
        """Sail a manoeuvre and judge where it leads: `path` and `contact` in one."""
        c = circles
        found = self._kernel.judge(motion, thrust, law, push, c.p_L, c.v_L, c.radius, c.horizon_s)
        return _contact(found, c)


def _contact(found: tuple[float, float, float, int, bool], circles: Circles) -> Contact:
    harm, time_s, speed_mps, circle, to_starboard = found
    if circle < 0:
        return NO_CONTACT
    return Contact(harm, time_s, speed_mps, circles.id[circle], to_starboard)

"""What wind and current do to the vessel, learnt from how it moves: a disturbance observer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND
from twinscrew.runtime.safety.assurance_vessel import STILL, Motion, Push, Thrust


class _Moment(NamedTuple):
    stamp_ns: int
    motion: Motion
    heading: float


class DisturbanceObserver:
    """Holds the motion against the model's; what is left over, smoothed, is the disturbance.

    Newton's second law in the vessel's frame, with the model's forces at the mean of two motions::

        F_B = M (nu_k - nu_(k-1)) / dt - M nu'_model(mean nu, thrust)

    It is turned into frame N, where wind and current stay when the vessel turns, and goes through a
    first-order low pass, so that waves leave little of themselves.
    """

    LONGEST_S = 0.5
    """[s] Over a longer gap the mean of the motions says nothing of what happened in between."""

    def __init__(
        self,
        acceleration: Callable[[Motion, Thrust], tuple[float, float, float]],
        inertia: tuple[float, float],
        *,
        time_constant_s: float,
        limit_n: float,
    ) -> None:
        """Begin with no disturbance.

        Parameters
        ----------
        acceleration
            The model's, of a motion and a thrust [m/s2, rad/s2].
        inertia
            In surge and sway, added mass included [kg].
        time_constant_s
            Of the low pass [s].
        limit_n
            The estimate is never greater [N]; 0: there is none.
        """
        self._acceleration = acceleration
        self._inertia = inertia
        self._time_constant_s = time_constant_s
        self._limit_n = limit_n
        self._force_N: Push = STILL
        self._before: _Moment | None = None

    def pause(self) -> None:
        """Learn nothing from the time until the next step: who knows what acts in it."""
        self._before = None

    def step(self, stamp_ns: int, motion: Motion, heading: float, thrust: Thrust) -> Push:
        """Learn from one more motion.

        Parameters
        ----------
        stamp_ns, motion, heading
            How the vessel moves [levelled frame L] and lies [rad] at a time.
        thrust
            What the propellers gave since the last step.

        Returns
        -------
        push
            The disturbance [N], in the vessel's present levelled frame.
        """
        before, self._before = self._before, _Moment(stamp_ns, motion, heading)
        if before is not None and self._limit_n > 0.0:
            dt = (stamp_ns - before.stamp_ns) / NANOSECONDS_PER_SECOND
            if 0.0 < dt <= self.LONGEST_S:
                midway = heading - math.remainder(heading - before.heading, math.tau) / 2.0
                push = self._left_over(before.motion, motion, thrust, dt)
                self._learn(_turned(push, -midway), dt)
        return _turned(self._force_N, heading)

    def _left_over(self, before: Motion, now: Motion, thrust: Thrust, dt: float) -> Push:
        (u0, v0, r0), (u1, v1, r1), (m11, m22) = before, now, self._inertia
        mean = Motion((u0 + u1) / 2.0, (v0 + v1) / 2.0, (r0 + r1) / 2.0)
        surge, sway, _ = self._acceleration(mean, thrust)
        return m11 * ((u1 - u0) / dt - surge), m22 * ((v1 - v0) / dt - sway)

    def _learn(self, force_N: Push, dt: float) -> None:
        share = 1.0 - math.exp(-dt / self._time_constant_s)
        north = self._force_N[0] + share * (force_N[0] - self._force_N[0])
        east = self._force_N[1] + share * (force_N[1] - self._force_N[1])
        size = math.hypot(north, east)
        if not math.isfinite(size):
            return  # what is learnt once stays: no bad message may spoil it
        shrink = min(1.0, self._limit_n / size) if size > 0.0 else 0.0
        self._force_N = (shrink * north, shrink * east)


def _turned(force: Push, angle: float) -> Push:
    """Give a force in axes that are turned by an angle [rad] from its own, clockwise."""
    c, s = math.cos(angle), math.sin(angle)
    return c * force[0] + s * force[1], c * force[1] - s * force[0]

"""The equations of `runtime.policy.vessel_model`, laid out for speed: components first, in place.

Two things make it fast. Every coefficient is premultiplied by the time step and divided by the
inertia. And the velocities do not depend on the place, so that they are integrated first, sub-step
by sub-step, and headings and places follow for all sub-steps at once. A test holds it against
`VesselModel.step`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters


class Coefficients:
    """What the equations need of N vessels; arrays (3, 1) serve vessels that are all alike."""

    def __init__(self, parameters: VesselParameters, dt: float, vessels: int = 1) -> None:
        self.dt = dt
        self.keep = np.empty((3, vessels))
        """[-] 1 - dt D_linear / M: what is left of nu."""
        self.drag = np.empty((3, vessels))
        """[s/m, s/m, -] dt D_quadratic / M."""
        self.coriolis = np.empty((3, vessels))
        """dt times the factors of v r, u r, u v in -C(nu) nu, over M."""
        self.gain = np.empty((3, vessels))
        """[s/kg, s/kg, s/(kg m2)] dt / M."""
        self.lever = np.empty(vessels)
        """[m] From the centre line to a thruster."""
        self.assign(np.arange(vessels), np.array(physical(parameters))[:, None])

    def assign(self, which: NDArray[np.intp], values: Float64) -> None:
        """Set some vessels' coefficients from their `physical` values, (10, n)."""
        inertia = values[:3]
        m11, m22 = inertia[0], inertia[1]
        coriolis = np.stack([m22, -m11, m11 - m22])
        self.gain[:, which] = self.dt / inertia
        self.keep[:, which] = 1.0 - self.dt * values[3:6] / inertia
        self.drag[:, which] = self.dt * values[6:9] / inertia
        self.coriolis[:, which] = self.dt * coriolis / inertia
        self.lever[which] = values[9]


def physical(p: VesselParameters) -> tuple[float, ...]:
    """Give the ten values that fix the motion: inertia, linear, quadratic drag (3 each), lever."""
    return (*p.inertia, *p.linear_drag, *p.quadratic_drag, p.lever)


class Dynamics:
    """Moves N vessels through the sub-steps of one decision; keeps its workspace."""

    def __init__(self, coefficients: Coefficients, vessels: int, substeps: int) -> None:
        self.coefficients = coefficients
        self.trajectory = np.zeros((substeps + 1, 2, vessels))
        """[m] (S + 1, 2, N) North and east at the decision and after every sub-step."""
        self.headings = np.zeros((substeps + 1, vessels))
        """[rad] (S + 1, N)"""
        self._nu = np.zeros((substeps + 1, 3, vessels))
        self._over_ground = np.empty((substeps, 2, vessels))
        self._impulse = np.empty((3, vessels))
        self._products = np.empty((3, vessels))
        self._factor = np.empty((3, vessels))

    def advance(
        self,
        position: Float64,
        heading: Float64,
        nu: Float64,
        force: Callable[[Float64], Float64],
    ) -> None:
        """Move all vessels in place and fill `trajectory`.

        Parameters
        ----------
        position : (2, N) float64
            North, east [m].
        heading : (N,) float64
            [rad]
        nu : (3, N) float64
            Surge, sway [m/s], yaw rate [rad/s].
        force
            Gives tau, (3, N) [N, N, N m], of the next sub-step by nu at its beginning; the very
            same array again means the same force.
        """
        self._nu[0] = nu
        tau = None
        for before, after in zip(self._nu[:-1], self._nu[1:], strict=True):
            last, tau = tau, force(before)
            if tau is not last:
                np.multiply(tau, self.coefficients.gain, out=self._impulse)
            self._accelerate(before, after)
        self._follow(position, heading)
        position[:], heading[:], nu[:] = self.trajectory[-1], self.headings[-1], self._nu[-1]

    def _accelerate(self, nu: Float64, after: Float64) -> None:
        """Give nu + dt M^-1 (tau - C(nu) nu - D(nu) nu); dt M^-1 tau is `_impulse`."""
        c, products, factor = self.coefficients, self._products, self._factor
        np.multiply(nu[1::-1], nu[2], out=products[:2])  # v r, u r
        np.multiply(nu[0], nu[1], out=products[2])  # u v
        products *= c.coriolis
        np.abs(nu, out=factor)
        factor *= c.drag
        np.subtract(c.keep, factor, out=factor)
        np.multiply(nu, factor, out=after)
        after += products
        after += self._impulse

    def _follow(self, position: Float64, heading: Float64) -> None:
        """Sum up headings and places: by the heading before, the velocity after each sub-step."""
        moved = self._nu[1:] * self.coefficients.dt
        _sum_up(self.headings, heading, moved[:, 2])
        # North + i east = (surge + i sway) exp(i heading): half the time of a sine and a cosine.
        shift = np.exp(1j * self.headings[:-1])
        shift *= moved[:, 0] + 1j * moved[:, 1]
        self._over_ground[:, 0], self._over_ground[:, 1] = shift.real, shift.imag
        _sum_up(self.trajectory, position, self._over_ground)


def _sum_up(into: Float64, start: Float64, changes: Float64) -> None:
    """Write the start and every partial sum; row by row, for rows are long and few."""
    into[0] = start
    for before, change, after in zip(into[:-1], changes, into[1:], strict=True):
        np.add(before, change, out=after)

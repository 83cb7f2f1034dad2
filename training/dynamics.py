"""The equations of `runtime.policy.vessel_model`, laid out for speed: components first, in place.

Each coefficient is premultiplied by the time step and divided by the inertia, so that one sub-step
of all vessels is about twenty array operations. A test holds it against `VesselModel.step`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.vessel_model import VesselParameters


class Coefficients:
    """What the equations need of each vessel: arrays (3, 1) if all are alike, else (3, N)."""

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
        self.assign(slice(None), *_rows(parameters))

    def assign(
        self,
        which: object,
        inertia: Float64,
        linear: Float64,
        quadratic: Float64,
        coriolis: Float64,
        lever: Float64,
    ) -> None:
        """Set the coefficients of some vessels from physical values, (3, n) and (n,)."""
        self.gain[:, which] = self.dt / inertia  # type: ignore[index]
        self.keep[:, which] = 1.0 - self.dt * linear / inertia  # type: ignore[index]
        self.drag[:, which] = self.dt * quadratic / inertia  # type: ignore[index]
        self.coriolis[:, which] = self.dt * coriolis / inertia  # type: ignore[index]
        self.lever[which] = lever  # type: ignore[index]


def _rows(p: VesselParameters) -> tuple[Float64, Float64, Float64, Float64, Float64]:
    """Give a vessel's physical values as columns."""
    columns = (p.inertia, p.linear_drag, p.quadratic_drag, p.coriolis)
    inertia, linear, quadratic, coriolis = (np.array(c)[:, None] for c in columns)
    return inertia, linear, quadratic, coriolis, np.array([p.lever])


class Dynamics:
    """Moves N vessels through the sub-steps of one decision; keeps its workspace."""

    def __init__(self, coefficients: Coefficients, vessels: int, substeps: int) -> None:
        self.coefficients = coefficients
        self.trajectory = np.zeros((substeps + 1, 2, vessels))
        """[m] (S + 1, 2, N) North and east at the decision and after every sub-step."""
        self._impulse = np.empty((3, vessels))
        self._products = np.empty((3, vessels))
        self._factor = np.empty((3, vessels))
        self._axes = np.empty((3, vessels))  # -sin, cos, sin of the heading
        self._shift = np.empty((2, 2, vessels))

    def advance(
        self,
        position: Float64,
        heading: Float64,
        nu: Float64,
        force: Callable[[int], Float64],
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
            Gives tau, (3, N) [N, N, N m], of a sub-step by its number.
        """
        self.trajectory[0] = position
        for substep in range(1, len(self.trajectory)):
            self._accelerate(nu, force(substep - 1))
            self._move(self.trajectory[substep], self.trajectory[substep - 1], heading, nu)
        position[:] = self.trajectory[-1]

    def _accelerate(self, nu: Float64, tau: Float64) -> None:
        """Add dt M^-1 (tau - C(nu) nu - D(nu) nu)."""
        c = self.coefficients
        products, factor = self._products, self._factor
        np.multiply(nu[1::-1], nu[2], out=products[:2])  # v r, u r
        np.multiply(nu[0], nu[1], out=products[2])  # u v
        products *= c.coriolis
        np.abs(nu, out=factor)
        factor *= c.drag
        np.subtract(c.keep, factor, out=factor)
        nu *= factor
        nu += products
        nu += np.multiply(tau, c.gain, out=self._impulse)

    def _move(self, to: Float64, start: Float64, heading: Float64, nu: Float64) -> None:
        """Move by dt along the heading of before with the velocity of after."""
        axes, shift, dt = self._axes, self._shift, self.coefficients.dt
        np.cos(heading, out=axes[1])
        np.sin(heading, out=axes[2])
        np.negative(axes[2], out=axes[0])
        np.multiply(axes[1:], nu[0], out=shift[0])  # (cos, sin) surge
        np.multiply(axes[:2], nu[1], out=shift[1])  # (-sin, cos) sway
        shift[0] += shift[1]
        shift[0] *= dt
        np.add(start, shift[0], out=to)
        heading += np.multiply(nu[2], dt, out=shift[1, 0])

"""The model: Fossen's equations in the plane, with thrust curve, lag, wind and current.

Many candidates of the parameters are simulated at once, over all windows of what was recorded, so
that a Jacobian by finite differences is one call.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from twinscrew.hil_sim.identification.recorded import DT_S
from twinscrew.hil_sim.vessel.dynamics import join
from twinscrew.runtime.vessel_description import VesselDescription

Array = NDArray[np.float64]

BENDS: Final = np.array([0.1, 0.25, 0.45, 0.7])
"""[-] Where, between the dead band and full, the thrust may differ from the file's curve."""
GRID: Final = np.linspace(0.0, 1.0, 41)
"""[-] Where a curve is kept, between the dead band and full."""
MOST_DEAD: Final = 0.3
"""[-] A dead band is not wider than this."""
DEAD_SIGMA: Final = 0.05
"""[-] How much wider or narrower than the file's a dead band may well be."""
STEPS: Final = 2
"""[-] The model's step, in steps of `DT_S`; the thrust is averaged over it."""
LEAST_ADDED: Final = 0.05
"""[-] Added mass in surge and sway may differ from the file's by a factor of at least this share of
the mass."""


class Parameter(NamedTuple):
    """A parameter: how it is called, and how far it may lie from the vessel's file."""

    name: str
    sigma: float
    """[-] Of the logarithm of a factor, of a logit, or of the number itself: see `_values`."""


HULL: Final = (
    Parameter("surge_added_mass", 0.8),
    Parameter("sway_added_mass", 0.8),
    Parameter("yaw_inertia", 0.5),
    Parameter("surge_drag", 0.6),
    Parameter("surge_linear_share", 1.5),
    Parameter("sway_drag", 1.0),
    Parameter("sway_linear_share", 1.5),
    Parameter("yaw_drag", 1.0),
    Parameter("yaw_linear_share", 1.5),
    Parameter("thrust_ahead", 0.35),
    Parameter("ahead_1", 0.8),
    Parameter("ahead_2", 0.6),
    Parameter("ahead_3", 0.4),
    Parameter("ahead_4", 0.3),
    Parameter("dead_ahead", 1.0),
    Parameter("thrust_astern", 0.5),
    Parameter("astern_1", 0.8),
    Parameter("astern_2", 0.6),
    Parameter("astern_3", 0.4),
    Parameter("astern_4", 0.3),
    Parameter("dead_astern", 1.0),
    Parameter("lag", 1.2),
    Parameter("right_by_left", 0.05),
    Parameter("wind_moment", 0.7),
    Parameter("centre_ahead", 0.04),
)
DAY: Final = (
    Parameter("wind_north", 8.0),
    Parameter("wind_east", 8.0),
    Parameter("current_north", 0.5),
    Parameter("current_east", 0.5),
)
"""Of every day, after the hull's."""


@dataclass(frozen=True, slots=True)
class Prior:
    """The vessel's file as the parameters' origin."""

    vessel: VesselDescription
    curve: Array
    """[-] (2, 41) Shares of full thrust at `GRID` beyond the dead band: ahead, astern."""
    dead: Array
    """[-] (2,) Dead bands ahead and astern."""
    centre_m: float
    """[m] How far ahead of the origin the centre of gravity lies."""

    @classmethod
    def of(cls, vessel: VesselDescription) -> Prior:
        """Read a vessel's curve."""
        curve, dead = np.empty((2, len(GRID))), np.empty(2)
        pairs = np.array(vessel.thrusters.curve or straight(vessel))
        for row, sign in enumerate((1.0, -1.0)):
            at, force = sign * pairs[:, 0], sign * pairs[:, 1]
            order = np.argsort(at)
            at, force = at[order], np.maximum(force[order], 0.0)
            zero = at[(force <= 1e-9) & (at >= 0.0)]
            dead[row] = min(float(zero.max()) if len(zero) else 0.0, MOST_DEAD)
            beyond = dead[row] + (1.0 - dead[row]) * GRID
            curve[row] = np.interp(beyond, at, force) / max(float(force[-1]), 1e-9)
        return cls(vessel, curve, dead, float(join(vessel.parts).centre_B[0]))


def straight(vessel: VesselDescription) -> tuple[tuple[float, float], ...]:
    """Give the curve of a vessel whose file has none."""
    thrusters = vessel.thrusters
    return (-1.0, thrusters.min_n), (0.0, 0.0), (1.0, thrusters.max_n)


class Values(NamedTuple):
    """Parameters in SI units; every one is (P, 1), of P candidates at a time."""

    mass: Array
    """(P, 3) Surge, sway [kg], yaw [kg m2], with added mass."""
    linear: Array
    """(P, 3)"""
    quadratic: Array
    """(P, 3)"""
    full: Array
    """[N] (P, 2) Of one propeller, ahead and astern, both positive."""
    curve: Array
    """[-] (P, 2, 41) At `GRID`."""
    dead: Array
    """[-] (P, 2)"""
    lag: Array
    """[s] (P,)"""
    right: Array
    """[-] (P,) The right propeller's thrust by the left one's."""
    windage: Array
    """(P, 3) Along, across, yaw."""
    centre_m: Array
    """[m] (P,) How far ahead of the origin the centre of gravity lies."""
    wind_N: Array
    """[m/s] (P, D, 2) Of every day."""
    current_N: Array
    """[m/s] (P, D, 2)"""


def values(theta: Array, prior: Prior) -> Values:
    """Turn parameters, (P, K), which are 0 at the vessel's file, into SI units."""
    vessel = prior.vessel
    named = {sway.name: theta[:, i] for i, sway in enumerate(HULL)}
    mass = np.empty((len(theta), 3))
    for i, name in enumerate(("surge", "sway")):
        added = vessel.added_mass[i] / vessel.mass_kg
        changed = max(added, LEAST_ADDED) * (np.exp(named[f"{name}_added_mass"]) - 1.0)
        mass[:, i] = vessel.mass_kg * (1.0 + added + changed)
    mass[:, 2] = vessel.plane_inertia[2] * np.exp(named["yaw_inertia"])
    reference = references(vessel)
    linear, quadratic = np.empty((len(theta), 3)), np.empty((len(theta), 3))
    for i, (name, axis) in enumerate((("surge", 0), ("sway", 1), ("yaw", 5))):
        at = reference[i]
        first, second = vessel.linear_drag[axis] * at, vessel.quadratic_drag[axis] * at**2
        whole = max(first + second, 1e-9)
        share = min(max(first / whole, 0.03), 0.97)
        force = whole * np.exp(named[f"{name}_drag"])
        linear_share = _logistic(math.log(share / (1 - share)) + named[f"{name}_linear_share"])
        linear[:, i] = force * linear_share / at
        quadratic[:, i] = force * (1.0 - linear_share) / at**2
    thrusters = vessel.thrusters
    full = np.column_stack(
        [
            thrusters.max_n * np.exp(named["thrust_ahead"]),
            max(-thrusters.min_n, 1e-3) * np.exp(named["thrust_astern"]),
        ]
    )
    curve = np.empty((len(theta), 2, len(GRID)))
    dead = np.empty((len(theta), 2))
    for row, side in enumerate(("ahead", "astern")):
        bent = np.column_stack([*(named[f"{side}_{k}"] for k in (1, 2, 3, 4)), 0.0 * theta[:, 0]])
        between = np.array([np.interp(GRID, [*BENDS, 1.0], bends) for bends in bent])
        shape = np.maximum.accumulate(prior.curve[row] * np.exp(between), axis=1)
        curve[:, row] = np.minimum(shape / np.maximum(shape[:, -1:], 1e-9), 1.0)
        dead[:, row] = np.clip(prior.dead[row] + DEAD_SIGMA * named[f"dead_{side}"], 0, MOST_DEAD)
    days = (theta.shape[1] - len(HULL)) // len(DAY)
    day = theta[:, len(HULL) :].reshape(len(theta), days, len(DAY))
    windage = np.tile(
        [vessel.windage.along, vessel.windage.across, vessel.windage.yaw], (len(theta), 1)
    )
    windage[:, 2] *= np.exp(named["wind_moment"])
    return Values(
        mass=mass,
        linear=linear,
        quadratic=quadratic,
        full=full,
        curve=curve,
        dead=dead,
        lag=_lag(thrusters.time_constant_s, named["lag"]),
        right=np.exp(named["right_by_left"]),
        windage=windage,
        centre_m=prior.centre_m + vessel.length_m * named["centre_ahead"],
        wind_N=day[:, :, :2],
        current_N=day[:, :, 2:],
    )


def references(vessel: VesselDescription) -> tuple[float, float, float]:
    """[m/s, m/s, rad/s] Where linear and quadratic drag are compared."""
    top = vessel.top_speed_mps
    return 0.7 * top, 0.3 * top, 0.7 * top / vessel.length_m


def _lag(known_s: float, x: Array) -> Array:
    """[s] A file may say that there is none, so that no factor leads to another lag."""
    return np.maximum(known_s + max(known_s, 0.05) * (np.exp(x) - 1.0), 1e-3)


def _logistic(x: Array) -> Array:
    return 1.0 / (1.0 + np.exp(-x))


def steady_thrust(found: Values, row: int, command: Array) -> Array:
    """Give the left propeller's thrust [N] at commands of any shape, by the candidate `row`."""
    total = np.zeros_like(command)
    for sign, side in ((1.0, 0), (-1.0, 1)):
        dead = found.dead[row, side]
        beyond = np.clip((sign * command - dead) / (1.0 - dead), 0.0, 1.0)
        pushes = np.where(sign * command > dead, np.interp(beyond, GRID, found.curve[row, side]), 0)
        total += sign * found.full[row, side] * pushes
    return total


def thrust(found: Values, row: int, command: Array) -> Array:
    """Give each step's mean thrust, (T, 2) [N], after curve and lag, of the candidate `row`."""
    forces = steady_thrust(found, row, command) * np.array([1.0, found.right[row]])
    lag = float(found.lag[row])
    keep = math.exp(-DT_S / lag)
    # The thrust at each step's end, from the command that was held during the step.
    ends = lfilter([1.0 - keep], [1.0, -keep], forces, axis=0, zi=keep * forces[:1])[0]
    begins = np.vstack([forces[:1], ends[:-1]])
    return np.asarray(forces + (begins - forces) * (lag / DT_S) * (1.0 - keep))


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of all pieces: W of them, each of H steps."""

    start: Array
    """(W, 6) Measured beginnings: pose, velocities."""
    measured: Array
    """(W, H, 6) What came after."""
    at: NDArray[np.int64]
    """(W,) Row of each beginning in all pieces laid end to end."""
    day: NDArray[np.int64]
    """(W,)"""
    block: NDArray[np.int64]
    """(W,) Number of its stretch of `BLOCK_S`."""
    held_out: NDArray[np.bool_]
    """(W,)"""

    def __getitem__(self, rows: NDArray[Any]) -> Windows:
        return Windows(
            self.start[rows],
            self.measured[rows],
            self.at[rows],
            self.day[rows],
            self.block[rows],
            self.held_out[rows],
        )


def predict(found: Values, prior: Prior, windows: Windows, command: Array, every: int = 1) -> Array:
    """Predict windows with each of P candidates.

    Parameters
    ----------
    command : (T, 2) float64
        All pieces' commands, end to end.

    Returns
    -------
    states : (P, W, H / STEPS / every, 6) float64
        Pose and velocities over ground, after every so many of the model's steps.
    """
    count, steps = len(found.lag), windows.measured.shape[1]
    dt = STEPS * DT_S
    lever = prior.vessel.lever_m
    rows = windows.at[:, None] + np.arange(steps)
    pushes = np.stack([thrust(found, p, command)[rows] for p in range(count)])
    steps //= STEPS
    pushes = pushes[:, :, : steps * STEPS].reshape(count, -1, steps, STEPS, 2).mean(axis=3)
    surge_n = pushes.sum(axis=-1)
    yaw_nm = lever * (pushes[..., 0] - pushes[..., 1])
    current = found.current_N[:, windows.day]
    wind = found.wind_N[:, windows.day]
    n, e, psi, u, v, r = (np.tile(column, (count, 1)) for column in windows.start.T)
    c, s = np.cos(psi), np.sin(psi)
    u = u - c * current[..., 0] - s * current[..., 1]
    v = v - c * current[..., 1] + s * current[..., 0]
    m11, m22, m33 = (found.mass[:, i, None] for i in range(3))
    l1, l2, l3 = (found.linear[:, i, None] for i in range(3))
    q1, q2, q3 = (found.quadratic[:, i, None] for i in range(3))
    offset = prior.vessel.mass_kg * found.centre_m[:, None]
    det = m22 * m33 - offset**2
    along, across, about = (found.windage[:, i, None] for i in range(3))

    def slope(psi: Array, u: Array, v: Array, r: Array, k: int) -> tuple[Array, ...]:
        c, s = np.cos(psi), np.sin(psi)
        north = c * u - s * v + current[..., 0]
        east = s * u + c * v + current[..., 1]
        blows = wind[..., 0] - north, wind[..., 1] - east
        wx, wy = c * blows[0] + s * blows[1], c * blows[1] - s * blows[0]
        px, py = m11 * u, m22 * v + offset * r  # momentum: Kirchhoff's equations
        du = r * py - (l1 + q1 * np.abs(u)) * u + surge_n[..., k] + along * wx * np.abs(wx)
        dv = -r * px - (l2 + q2 * np.abs(v)) * v + across * wy * np.abs(wy)
        dr = v * px - u * py - (l3 + q3 * np.abs(r)) * r + yaw_nm[..., k]
        dr = dr - 2.0 * about * wx * wy
        return (
            north,
            east,
            r,
            du / m11,
            (m33 * dv - offset * dr) / det,
            (m22 * dr - offset * dv) / det,
        )

    out = np.empty((count, len(windows.at), steps // every, 6))
    for k in range(steps):  # Heun's method
        first = slope(psi, u, v, r, k)
        middle = (psi + dt * first[2], u + dt * first[3], v + dt * first[4])
        second = slope(*middle, r + dt * first[5], k)
        half = 0.5 * dt
        n, e = n + half * (first[0] + second[0]), e + half * (first[1] + second[1])
        psi = psi + half * (first[2] + second[2])
        u, v = u + half * (first[3] + second[3]), v + half * (first[4] + second[4])
        r = r + half * (first[5] + second[5])
        if (k + 1) % every:
            continue
        c, s = np.cos(psi), np.sin(psi)
        over_u = u + c * current[..., 0] + s * current[..., 1]
        over_v = v + c * current[..., 1] - s * current[..., 0]
        for i, value in enumerate((n, e, psi, over_u, over_v, r)):
            out[:, :, k // every, i] = value
    return out

"""The assurance's prediction and its judgement of contact, in plain Python and numpy.

The equations of `policy.vessel_model` (Fossen (2021), chapters 3 and 6) for one vessel, and every
gap at every time as one array: some 50 times slower than ``runtime/native/assurance.hpp``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.safety.prediction import (
    NO_CONTACT,
    STILL,
    AssuranceVessel,
    Circles,
    Contact,
    Motion,
    Push,
    Thrust,
    slewed,
)

Law = Callable[[float, float], Thrust]
"""What a manoeuvre wants of the propellers, by the time from now [s] and the surge then [m/s]."""


def predict(
    vessel: AssuranceVessel,
    motion: Motion,
    thrust: Thrust,
    law: Law,
    *,
    steps: int,
    dt: float,
    slew_nps: float,
    push: Push = STILL,
) -> Float64:
    """Sail a manoeuvre: Euler steps of the velocity, trapezoids of the position.

    Parameters
    ----------
    motion, thrust
        How the vessel moves, and what its propellers give, now.
    law
        The manoeuvre.
    steps : int
        Number of time steps T.
    dt : float
        Their length [s].
    slew_nps : float
        How fast each thrust may change [N/s].
    push
        A force that stays the same over ground [N], in the vessel's present levelled frame.

    Returns
    -------
    path : (T + 1, 3) float64
        x, y [m], heading [rad], from now on, in the vessel's present levelled frame.
    """
    (m11, m22, m66), lever = vessel.inertia, vessel.lever_m
    (x_u, y_v, n_r), (x_uu, y_vv, n_rr) = vessel.linear_drag, vessel.quadratic_drag
    u, v, r = motion
    x = y = heading = 0.0
    path = [(x, y, heading)]
    for step in range(steps):
        wanted = law(step * dt, u)
        if wanted != thrust:
            thrust = slewed(thrust, wanted, slew_nps * dt)
        left, right = thrust
        c, s = math.cos(heading), math.sin(heading)
        surge = left + right + m22 * v * r - (x_u + x_uu * abs(u)) * u + c * push[0] + s * push[1]
        sway = -m11 * u * r - (y_v + y_vv * abs(v)) * v + c * push[1] - s * push[0]
        yaw = (left - right) * lever + (m11 - m22) * u * v - (n_r + n_rr * abs(r)) * r
        # The mean of the velocities before and after: the new ones alone would brake too well.
        du, dv, dr = dt * surge / m11, dt * sway / m22, dt * yaw / m66
        ahead, across, turn = u + du / 2.0, v + dv / 2.0, dt * (r + dr / 2.0)
        cosine, sine = math.cos(heading + turn / 2.0), math.sin(heading + turn / 2.0)
        x += dt * (cosine * ahead - sine * across)
        y += dt * (sine * ahead + cosine * across)
        u, v, r, heading = u + du, v + dv, r + dr, heading + turn
        path.append((x, y, heading))
    return np.array(path)


def worst_contact(
    path: Float64,
    circles: Circles,
    hull: tuple[tuple[float, float], ...],
    *,
    dt: float,
    margin_m: float,
    approach_per_s: float,
) -> Contact:
    """Judge a path.

    Nearer than the margin, closing in is allowed at `approach_per_s` times the gap that is left, so
    that a vessel may pass along an edge, or lie beside it, but not run into it; within it, it has
    to leave as fast (as from 0.2 m at most). What comes later counts less, down to nothing at the
    track's horizon: until then there is time to decide again. Harm is the greatest excess, and its
    integral times 1 /s.

    Parameters
    ----------
    path : (T + 1, 3) float64
        x, y [m], heading [rad] in the present frame B, `dt` [s] apart, the first one now.
    circles
        What is around.
    hull
        [m] Circles that cover the own hull: how far ahead of the origin, radius.
    """
    steps = len(path) - 1
    gap = gaps(path, circles, hull, dt)
    if gap.min() >= margin_m:
        return NO_CONTACT
    closing = (gap[:-1] - gap[1:]) / dt
    allowed = approach_per_s * np.maximum(gap[1:], -0.2)
    weight = 1.0 - dt * np.arange(1, steps + 1)[:, None, None] / (circles.horizon_s + dt)
    excess = np.where(gap[1:] < margin_m, (closing - allowed) * np.maximum(weight, 0.0), 0.0)
    harmful = (excess > 0.0).any(axis=(1, 2))
    if not harmful.any():
        return NO_CONTACT
    first = int(np.argmax(harmful))
    _, k = divmod(int(np.argmax(excess[first])), len(circles.id))
    x, y, heading = path[first + 1]
    there = circles.p_L[k] + (first + 1) * dt * circles.v_L[k] - (x, y)
    return Contact(
        excess=float(excess.max() + 1.0 * dt * np.maximum(excess, 0.0).max(axis=(1, 2)).sum()),
        time_s=(first + 1) * dt,
        speed_mps=float(closing[first, :, k].max()),
        track=circles.id[k],
        to_starboard=bool(np.cos(heading) * there[1] > np.sin(heading) * there[0]),
    )


def gaps(
    path: Float64, circles: Circles, hull: tuple[tuple[float, float], ...], dt: float
) -> Float64:
    """Give the distances between surfaces along a path, (T + 1, H, K) [m]; see `worst_contact`."""
    ahead, own = np.array(hull).T
    # Points of the plane as complex numbers, x + iy: a rotation is one product.
    here = path[:, :2].copy().view(np.complex128)
    if ahead.any():
        here = here + ahead * np.exp(1j * path[:, 2:])
    there = circles.p_L.view(np.complex128).T
    there = there + dt * np.arange(len(path))[:, None] * circles.v_L.view(np.complex128).T
    apart: Float64 = np.abs(there[:, None] - here[:, :, None])
    apart -= own[:, None] + circles.radius
    return apart

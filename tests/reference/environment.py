"""A slow scalar reference of one decision, written from the equations: no arrays, no tricks."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

DT = 0.05
SUBSTEPS = 10
RADIUS = 0.5 * math.hypot(5.0, 2.5)
BUOY_RADIUS = 1.0


@dataclass
class Vessel:
    """One vessel: pose in N, velocity in B, thrusts, goal."""

    x: float
    y: float
    psi: float
    u: float
    v: float
    r: float
    left: float
    right: float
    goal_x: float
    goal_y: float
    there: bool = True

    @property
    def to_goal(self) -> float:
        return math.hypot(self.goal_x - self.x, self.goal_y - self.y)

    @property
    def velocity(self) -> tuple[float, float]:
        c, s = math.cos(self.psi), math.sin(self.psi)
        return c * self.u - s * self.v, s * self.u + c * self.v


def sub_step(b: Vessel) -> None:
    """Advance 0.05 s; M nu' + C_RB nu + C_A nu + D nu = tau with Fossen's matrices spelled out."""
    m, izz, x_udot, n_rdot = 400.0, 450.0, 20.0, -980.0
    a1, a2 = -x_udot, 0.0  # M_A = diag(a1, a2, -n_rdot)
    # C_RB nu (Fossen 2021, eq. 3.63, x_g = 0) and C_A nu (eq. 6.54)
    c1 = -m * b.v * b.r - a2 * b.v * b.r
    c2 = m * b.u * b.r + a1 * b.u * b.r
    c3 = a2 * b.v * b.u - a1 * b.u * b.v
    d1 = (100.0 + 150.0 * abs(b.u)) * b.u
    d2 = (100.0 + 150.0 * abs(b.v)) * b.v
    d3 = (980.0 + 950.0 * abs(b.r)) * b.r
    tau1, tau3 = b.left + b.right, (b.left - b.right) * 2.5 / 2
    u = b.u + DT * (tau1 - c1 - d1) / (m + a1)
    v = b.v + DT * (0.0 - c2 - d2) / (m + a2)
    r = b.r + DT * (tau3 - c3 - d3) / (izz - n_rdot)
    b.u, b.v, b.r = u, v, r
    vx, vy = b.velocity
    b.x, b.y, b.psi = b.x + DT * vx, b.y + DT * vy, b.psi + DT * r


def decide(
    vessels: list[Vessel], buoys: list[complex], actions: list[tuple[float, float]]
) -> tuple[list[bool], list[bool]]:
    """Sail one decision; tell who touched a vessel and who a buoy."""
    touched_vessel, touched_buoy = [False] * len(vessels), [False] * len(vessels)
    for b, (left, right) in zip(vessels, actions, strict=True):
        if b.there:
            b.left = min(max(b.left + 1000.0 * min(max(left, -1), 1) * 0.5, -500.0), 1000.0)
            b.right = min(max(b.right + 1000.0 * min(max(right, -1), 1) * 0.5, -500.0), 1000.0)
    for _ in range(SUBSTEPS):
        for b in vessels:
            if b.there:
                sub_step(b)
        for i, b in enumerate(vessels):
            if not b.there:
                continue
            for j, other in enumerate(vessels):
                if j != i and other.there and math.hypot(b.x - other.x, b.y - other.y) < 2 * RADIUS:
                    touched_vessel[i] = True
            for buoy in buoys:
                if math.hypot(b.x - buoy.real, b.y - buoy.imag) < RADIUS + BUOY_RADIUS:
                    touched_buoy[i] = True
    return touched_vessel, touched_buoy


def perceive(
    k: int,
    vessels: list[Vessel],
    buoys: list[complex],
    noise: list[tuple[complex, complex, float]],
) -> list[tuple[float, float, float, float, float]]:
    """Give what vessel k sees: at most 5 objects, nearest surface first, in its own frame."""
    ego = vessels[k]
    turn = cmath.exp(-1j * ego.psi)
    found = []
    things = [(complex(b.x, b.y), complex(*b.velocity), RADIUS, b.there) for b in vessels]
    things += [(buoy, 0j, BUOY_RADIUS, True) for buoy in buoys]
    for number, (place, velocity, radius, there) in enumerate(things):
        wp, wv, factor = noise[number]
        p = place - complex(ego.x, ego.y) + wp
        if number == k or not there or abs(p) - radius > 20.0:
            continue
        p_L, v_L, r = p * turn, (velocity + wv) * turn, radius * factor
        found.append((abs(p) - r - RADIUS, (p_L.real, p_L.imag, v_L.real, v_L.imag, r)))
    return [row for _, row in sorted(found)[:5]]


def wrap(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


def colregs_delta(ego: Vessel, seen: list[tuple[float, float, float, float, float]]) -> float:
    """Give max(delta, 0) towards the closest moving object, 0 without a situation."""
    if math.hypot(ego.u, ego.v) < 0.5:
        return 0.0
    moving = [o for o in seen if math.hypot(o[2], o[3]) >= 0.5]
    if not moving:
        return 0.0
    px, py, vx, vy, radius = moving[0]
    course_other, course = math.atan2(vy, vx), math.atan2(ego.v, ego.u)
    angle = wrap(course - course_other)
    # the ego in the other's frame, x along the other's velocity
    x = -px * math.cos(course_other) - py * math.sin(course_other)
    y = px * math.sin(course_other) - py * math.cos(course_other)
    head_on = 0 <= x <= 17 and abs(y) <= 4.5 and abs(angle) > 3 * math.pi / 4
    zone = -9 <= x <= 12 and -17 <= y <= 0 and not y + 7 > -(7 / 12) * (x - 12)
    crossing = zone and math.pi / 4 <= angle <= 3 * math.pi / 4
    if not (head_on or crossing):
        return 0.0
    d, keep = math.hypot(px, py), radius + 1.0
    bearing = math.atan2(py, px)
    if d <= keep:
        compliant = bearing + math.pi
    else:
        tangent = math.sqrt(d * d - keep * keep)
        compliant = bearing + math.asin(keep / d) + math.atan2(RADIUS, tangent)
    return max(wrap(compliant - course), 0.0)

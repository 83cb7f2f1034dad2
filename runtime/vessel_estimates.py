"""Estimates of what a vessel's file does not give, from its eight main numbers.

A file may give better numbers for every one of these; docs/vessels.md lists them side by side. All
functions are pure, in SI units. Sources, as the docstrings cite them:

Fossen   T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed. (2021)
MSS      the same author's public Marine Systems Simulator, VESSELS/models/otter.m
VRX      VRX 2.3.2, the WAM-V's model
ours     no source: a choice that makes boats of 1 to 12 m behave plausibly
"""

from __future__ import annotations

import math
from typing import NamedTuple

Six = tuple[float, float, float, float, float, float]
"""Surge, sway, heave, roll, pitch, yaw."""

GRAVITY = 9.81
"""[m/s2]"""
AIR_DENSITY = 1.225
"""[kg/m3]"""
VISCOSITY = 1.19e-6
"""[m2/s] Kinematic, of sea water at 15 deg C (ITTC 7.5-02-01-03)."""
RESERVE = 2.5
"""[-] Greatest lift by weight: 2.54 for VRX's WAM-V."""
CROSS_FLOW = 1.0
"""[-] Drag coefficient of a section across the flow; 0.7 to 1.2 (Fossen, sec. 6.4)."""
SLOW_SHARE = 0.2
"""[-] Linear and quadratic drag are equal at this share of the top speed: VRX's WAM-V, 0.67 m/s."""


class Strips(NamedTuple):
    """The wet hull as two equal strips, each a half-immersed cylinder: VRX's buoyancy model.

    A catamaran's hulls are one strip each; the halves of a single hull are taken as strips that
    have its moment of waterplane area.
    """

    length: float
    """[m]"""
    radius: float
    """[m]"""
    half_spacing: float
    """[m] From the centre line to a strip."""
    immersion: float
    """[m] How deep a strip's lowest line is at rest."""
    hulls: int
    """[-] 1 or 2."""

    @property
    def half_width(self) -> float:
        """[m] Half of a strip's breadth at the waterline."""
        return math.sqrt(self.immersion * (2.0 * self.radius - self.immersion))


def hulls(length: float, beam: float) -> int:
    """Tell a catamaran from a single hull: 2 if the beam is over 0.4 of the length (ours)."""
    return 2 if beam > 0.4 * length else 1


def hull_radius(mass: float, length: float, density: float) -> float:
    """Give the radius [m] of two half cylinders that carry `RESERVE` times the mass [kg]."""
    return math.sqrt(RESERVE * mass / (math.pi * density * length))


def half_spacing(beam: float, hulls: int) -> float:
    """Give a strip's distance [m] from the centre line.

    Catamaran: 0.375 of the beam (WAM-V 0.41, Otter 0.37, Heron 0.39). Single hull: B / sqrt(12),
    the radius of gyration of its waterplane.
    """
    return 0.375 * beam if hulls == 2 else beam / math.sqrt(12.0)


def segment_area(radius: float, height: float) -> float:
    """Give the area [m2] of a circle's segment of a height [m] in [0, radius]."""
    rest = radius - height
    return radius**2 * math.acos(rest / radius) - rest * math.sqrt(radius**2 - rest**2)


def immersion(mass: float, length: float, radius: float, density: float) -> float:
    """Give how deep two strips lie in still water [m]: Archimedes, by bisection.

    The result is the radius itself where they carry too little.
    """
    low, high = 0.0, radius
    for _ in range(60):
        middle = 0.5 * (low + high)
        carried = 2.0 * density * length * segment_area(radius, middle)
        low, high = (middle, high) if carried < mass else (low, middle)
    return high


def inertia(mass: float, length: float, beam: float) -> tuple[float, float, float]:
    """Give moments of inertia about the centre of gravity [kg m2]: roll, pitch, yaw.

    Radii of gyration 0.4 B, 0.25 L, 0.25 L (MSS; Fossen, sec. 4.3).
    """
    return mass * (0.4 * beam) ** 2, mass * (0.25 * length) ** 2, mass * (0.25 * length) ** 2


def added_mass(strips: Strips, mass: float, density: float) -> Six:
    """Give the diagonal of M_A [kg, kg m2], positive.

    Surge: 2.7 rho V^(5/3) / L^2 for each hull (Soeding (1982); Fossen, sec. 6.5). Heave and yaw:
    strip theory with half circles, rho pi b^2 / 2 and rho pi T^2 / 2 a metre, b half the breadth
    (Newman (1977), table 4.3). Roll, pitch and yaw: the strips, times their distance squared.

    Sway: the same as surge. Strip theory would give more, and with it a Munk moment (Y - X) u v
    that turns the hull off its course. Skegs and propellers balance it on a real boat; a diagonal
    drag matrix cannot. MSS leaves the moment out for the Otter's sake; here it is zero so.
    """
    length, hulls = strips.length, strips.hulls
    volume = mass / density / hulls
    surge = hulls * 2.7 * density * volume ** (5.0 / 3.0) / length**2
    strip_sway = hulls * 0.5 * density * math.pi * strips.immersion**2 * length
    half_breadth = strips.half_width * (2.0 if hulls == 1 else 1.0)
    heave = hulls * 0.5 * density * math.pi * half_breadth**2 * length
    square = length**2 / 12.0
    return surge, surge, heave, heave * strips.half_spacing**2, heave * square, strip_sway * square


def surge_drag(thrust: float, top_speed: float) -> tuple[float, float]:
    """Give linear [kg/s] and quadratic [kg/m] drag in surge that balance a thrust [N] at a speed.

    X_u U + X_uu U^2 = 2 T_max, with X_u = X_uu v_0 and v_0 = `SLOW_SHARE` U.
    """
    slow = SLOW_SHARE * top_speed
    quadratic = thrust / (top_speed * (top_speed + slow))
    return slow * quadratic, quadratic


def cross_drag(strips: Strips, density: float) -> tuple[float, float]:
    """Give quadratic drag in sway [kg/m] and yaw [kg m2]: the cross-flow principle.

    Integrals of rho C_d T |v + x r| (v + x r) / 2 over each hull (Fossen, sec. 6.4), which are
    rho C_d T L / 2 and rho C_d T L^4 / 64.
    """
    per_metre = strips.hulls * 0.5 * density * CROSS_FLOW * strips.immersion
    return per_metre * strips.length, per_metre * strips.length**4 / 32.0


def upright_damping(strips: Strips, inertia: tuple[float, float, float], density: float) -> Six:
    """Give linear drag in heave, roll and pitch (the other three are 0).

    2 zeta sqrt(C M) with relative damping 0.3, 0.2 and 0.4 (MSS); C from the waterplane (Fossen,
    sec. 4.1), M with added mass.
    """
    stiffness = density * GRAVITY * 4.0 * strips.half_width * strips.length
    restoring = (stiffness, stiffness * strips.half_spacing**2, stiffness * strips.length**2 / 12.0)
    heave, roll, pitch = (
        2.0 * zeta * math.sqrt(c * m)
        for zeta, c, m in zip((0.3, 0.2, 0.4), restoring, inertia, strict=True)
    )
    return 0.0, 0.0, heave, roll, pitch, 0.0


def windage(length: float, beam: float) -> tuple[float, float, float]:
    """Give the coefficients of the wind's force along, across [N s2/m2] and in yaw [N s2/m].

    rho_a C A / 2 with C = 0.8 and side areas of 0.15 L of height (Fossen, sec. 10.1; area ours); in
    yaw C_N = 0.05 of the lateral area times length.
    """
    height = 0.15 * length
    pressure = 0.5 * AIR_DENSITY
    along, across = 0.8 * pressure * beam * height, 0.8 * pressure * length * height
    return along, across, 0.05 * pressure * length * height * length


def fastest(strips: Strips, thrust: float, density: float) -> float:
    """Give the speed [m/s] that friction alone allows with a thrust [N]; no hull is faster.

    R = rho S C_F U^2 / 2 with C_F = 0.075 / (log10 Re - 2)^2 (ITTC 1957), S the strips' wet skin.
    """
    girth = 2.0 * strips.radius * math.acos(1.0 - strips.immersion / strips.radius)
    skin = 2.0 * girth * strips.length
    low, high = 0.0, 100.0
    for _ in range(60):
        speed = 0.5 * (low + high)
        reynolds = max(speed * strips.length / VISCOSITY, 1e4)
        friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2
        drag = 0.5 * density * skin * friction * speed**2
        low, high = (speed, high) if drag < thrust else (low, speed)
    return low


def freeboard(length: float) -> float:
    """Give the height of the deck over the water [m]: 0.1 L, 0.15 m to 1 m (ours)."""
    return min(max(0.1 * length, 0.15), 1.0)


def mast(length: float) -> float:
    """Give the LiDAR's height over the deck [m]: 0.2 L, 0.3 m to 1.5 m (ours)."""
    return min(max(0.2 * length, 0.3), 1.5)

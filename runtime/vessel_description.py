"""One vessel, described once: everything that depends on the hull is derived from here.

A file in config/vessels (or anybody's own) has a table ``[vessel]``. Eight keys must be given; the
rest is estimated by `vessel_estimates`, and may be given instead. docs/vessels.md explains the
format. Positions are in the vessel's frame B: forward, starboard, down [m]. The origin lies on the
centre line; it is the point that odometry speaks of.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from twinscrew.runtime import vessel_estimates as estimate
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Count, NonNegative, Positive, Settings, load, shipped
from twinscrew.runtime.vessel_estimates import GRAVITY, Six, Strips

DEFAULT = "wam_v"
"""The vessel of whom is not told otherwise: the paper's."""

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Size = Annotated[float, Meta(gt=0.0, le=500.0)]
"""[m] Of a vessel; none is longer."""
Circle = tuple[float, Positive]
"""[m] How far ahead of the origin, radius."""
ORDER = ("surge", "sway", "heave", "roll", "pitch", "yaw")


class BoxPart(Settings, frozen=True, kw_only=True):
    """A box that a LiDAR sees: a hull, a house, a battery."""

    name: str = ""
    centre_m: Vector
    """[m] [B] Its centre."""
    size_m: tuple[Positive, Positive, Positive]
    """[m] Its whole lengths along its own axes."""
    rpy_rad: Vector = (0.0, 0.0, 0.0)
    """[rad] Roll, pitch, yaw of its axes in B (zyx Euler angles)."""
    mirrored: bool = False
    """True if a second one stands on the other side of the vessel."""


class CylinderPart(Settings, frozen=True, kw_only=True):
    """A cylinder with flat ends that a LiDAR sees: a mast, a float."""

    name: str = ""
    centre_m: Vector
    """[m] [B] Its centre."""
    axis: Vector
    """[-] [B] Direction of its axis, of any length but zero."""
    length_m: Positive
    radius_m: Positive
    mirrored: bool = False
    """True if a second one stands on the other side of the vessel."""


class Part(Settings, frozen=True, kw_only=True):
    """One rigid part, where a vessel's mass and inertia are summed from parts."""

    name: str
    mass_kg: Positive
    position_m: Vector
    """[m] [B] Its centre of gravity."""
    inertia_kgm2: tuple[NonNegative, NonNegative, NonNegative]
    """[kg m2] About its own centre, along the vessel's axes."""

    @property
    def position_B(self) -> Array:
        """[m] [B] (3,) Its centre of gravity."""
        return np.array(self.position_m)


class InertiaTable(Settings, frozen=True, kw_only=True):
    """Moments of inertia of the whole boat about its centre of gravity."""

    roll_kgm2: Positive | None = None
    pitch_kgm2: Positive | None = None
    yaw_kgm2: Positive | None = None
    centre_m: Vector | None = None
    """[m] [B] The centre of gravity."""


class SixTable(Settings, frozen=True, kw_only=True):
    """Six magnitudes, positive: kg or kg m2; kg/s or kg m2/s; kg/m or kg m2."""

    surge: NonNegative | None = None
    sway: NonNegative | None = None
    heave: NonNegative | None = None
    roll: NonNegative | None = None
    pitch: NonNegative | None = None
    yaw: NonNegative | None = None

    def over(self, estimated: Six) -> Six:
        """Give the six, estimated where the file gives none."""
        given = (getattr(self, name) for name in ORDER)
        surge, sway, heave, roll, pitch, yaw = (
            fallback if value is None else value
            for value, fallback in zip(given, estimated, strict=True)
        )
        return surge, sway, heave, roll, pitch, yaw


class BuoyancyTable(Settings, frozen=True, kw_only=True):
    """Hulls as half-immersed cylinders whose lift acts at points."""

    hull_length_m: Size | None = None
    """[m] of each hull."""
    hull_radius_m: Size | None = None
    """[m] A point immersed deeper than this carries no more."""
    points_per_hull: Count = 2
    """[-] Each point carries the hull's length divided by this."""
    points_m: Annotated[tuple[Vector, ...], Meta(min_length=1)] | None = None
    """[m] [B] Where the lift acts: the keel."""
    water_density_kgpm3: Positive = 1025.0
    """[kg/m3] Sea water."""
    gravity_mps2: Positive = GRAVITY


class ThrusterTable(Settings, frozen=True, kw_only=True):
    """Two propellers that push along the hull."""

    left_m: Vector | None = None
    """[m] [B] The left propeller."""
    right_m: Vector | None = None
    """[m] [B] The right propeller."""
    curve: tuple[tuple[float, float], ...] = ()
    """Thrust of one [N] over its command in [-1, 1], in rising order; empty: straight lines."""
    time_constant_s: NonNegative = 0.1
    """[s] With which thrust follows its command (electric thrusters 0.05 to 0.2; ours)."""
    slew_nps: NonNegative = 0.0
    """[N/s] Thrust changes no faster; 0: there is no such limit."""


class WindageTable(Settings, frozen=True, kw_only=True):
    """Force coefficients of the air."""

    along: NonNegative | None = None
    """[N s2/m2]"""
    across: NonNegative | None = None
    """[N s2/m2]"""
    yaw: NonNegative | None = None
    """[N s2/m]"""


class SensorTable(Settings, frozen=True, kw_only=True):
    """Where sensors sit."""

    lidar_m: Vector | None = None
    """[m] [B]"""
    antenna_m: Vector | None = None
    """[m] [B] Of the GPS."""
    imu_m: Vector | None = None
    """[m] [B]"""


class MaskTable(Settings, frozen=True, kw_only=True):
    """The own hull as seen from above: echoes from within are no objects."""

    aft_m: float
    fore_m: float
    half_width_m: Positive


class PlaneModel(Settings, frozen=True, kw_only=True):
    """The vessel in surge, sway and yaw with Fossen's signs: `policy.vessel_model`."""

    mass_kg: Positive
    izz: Positive
    x_udot: float
    y_vdot: float
    n_rdot: float
    x_u: float
    y_v: float
    n_r: float
    x_uu: float
    y_vv: float
    n_rr: float
    length: Positive
    width: Positive
    thrust_min_n: float
    thrust_max_n: float
    thruster_spacing_m: Positive | None = None


class VesselTable(Settings, frozen=True, kw_only=True):
    """The table ``[vessel]`` as people write it; None: estimated."""

    name: Annotated[str, Meta(min_length=1)]
    """What people call it."""
    length_m: Size
    """[m] Overall."""
    beam_m: Size
    """[m] Overall."""
    mass_kg: Positive
    """[kg] As it sails, with sensors and batteries."""
    thruster_spacing_m: float
    """[m] From the left propeller's shaft to the right one's."""
    thrust_max_n: Positive
    """[N] Greatest thrust ahead of each propeller."""
    thrust_min_n: Annotated[float, Meta(le=0.0)]
    """[N] Greatest thrust astern of each, negative."""
    top_speed_mps: Positive
    """[m/s] Ahead, with both at thrust_max_n, in calm water."""
    hulls: Annotated[int, Meta(ge=1, le=2)] | None = None
    waterline_m: Positive | None = None
    """[m] How high the water at rest stands over the origin; estimated: by balance of weight and
    lift, with the origin at the keel."""
    freeboard_m: Positive | None = None
    """[m] Height of the deck over the water."""
    circles_m: Annotated[tuple[Circle, ...], Meta(min_length=1)] | None = None
    """[m] Circles that hold the hull: nothing may touch them."""
    hull_boxes: bool = True
    """False where `box` and `cylinder` include the hulls: none is added for them."""
    inertia: InertiaTable = InertiaTable()
    added_mass: SixTable = SixTable()
    linear_drag: SixTable = SixTable()
    quadratic_drag: SixTable = SixTable()
    buoyancy: BuoyancyTable = BuoyancyTable()
    thrusters: ThrusterTable = ThrusterTable()
    windage: WindageTable = WindageTable()
    sensors: SensorTable = SensorTable()
    mask: MaskTable | None = None
    plane_model: PlaneModel | None = None
    """What policies train with and planners look ahead with, where that differs on purpose."""
    parts: tuple[Part, ...] = ()
    box: tuple[BoxPart, ...] = ()
    cylinder: tuple[CylinderPart, ...] = ()


class VesselFile(Settings, frozen=True, kw_only=True):
    """A file in config/vessels."""

    vessel: VesselTable


@dataclass(frozen=True, slots=True, kw_only=True)
class Buoyancy:
    """Hulls as half-immersed cylinders whose lift acts at points (VRX 2.3.2)."""

    hull_length_m: float
    hull_radius_m: float
    points_per_hull: int
    points_B: Array
    """[m] [B] (P, 3)"""
    water_density_kgpm3: float
    gravity_mps2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Thrusters:
    """Two propellers that push along the hull."""

    positions_B: Array
    """[m] [B] (2, 3) Left, right."""
    min_n: float
    max_n: float
    curve: tuple[tuple[float, float], ...]
    time_constant_s: float
    slew_nps: float


@dataclass(frozen=True, slots=True)
class Windage:
    """Force coefficients of the air [N s2/m2, N s2/m2, N s2/m]."""

    along: float
    across: float
    yaw: float


@dataclass(frozen=True, slots=True, kw_only=True)
class VesselDescription:
    """A vessel with every number, given or estimated. Six: surge, sway, heave, roll, pitch, yaw."""

    key: str
    """The shipped vessel's name or the file that it was read from."""
    name: str
    length_m: float
    beam_m: float
    mass_kg: float
    thruster_spacing_m: float
    top_speed_mps: float
    hulls: int
    waterline_m: float
    circles_m: tuple[Circle, ...]
    parts: tuple[Part, ...]
    added_mass: Six
    linear_drag: Six
    quadratic_drag: Six
    buoyancy: Buoyancy
    thrusters: Thrusters
    windage: Windage
    lidar_m: Vector
    antenna_m: Vector
    imu_m: Vector
    mask: MaskTable
    plane: PlaneModel
    """What policies train with and planners look ahead with."""
    boxes: tuple[BoxPart, ...]
    cylinders: tuple[CylinderPart, ...]

    @property
    def radius_m(self) -> float:
        """[m] Of one circle that holds the hull: half its diagonal, to the millimetre."""
        return round(math.hypot(self.length_m, self.beam_m) / 2, 3)

    @property
    def draught_m(self) -> float:
        """[m] From the water at rest down to the lowest thing that is described: hull, propeller.

        The propellers' blades are not described; add a margin for them.
        """
        points, places = self.buoyancy.points_B, self.thrusters.positions_B
        return self.waterline_m + max(0.0, float(places[:, 2].max()), float(points[:, 2].max()))

    @property
    def contact_radius_m(self) -> float:
        """[m] No circle reaches farther from the origin."""
        return max(abs(ahead) + radius for ahead, radius in self.circles_m)

    @property
    def lever_m(self) -> float:
        """[m] From the centre line to a propeller."""
        return self.thruster_spacing_m / 2

    @property
    def plane_inertia(self) -> tuple[float, float, float]:
        """[kg, kg, kg m2] Surge, sway, yaw about the origin, with added mass, to three digits."""
        mass = sum(part.mass_kg for part in self.parts)
        yaw = sum(
            part.inertia_kgm2[2] + part.mass_kg * math.hypot(*part.position_m[:2]) ** 2
            for part in self.parts
        )
        surge, sway, *_, turn = self.added_mass
        return _three_digits(mass + surge), _three_digits(mass + sway), _three_digits(yaw + turn)

    def stopping(self, rate_nps: float) -> tuple[float, float]:
        """Give time [s] and way [m] from top speed to rest with both propellers full astern.

        Parameters
        ----------
        rate_nps : float
            How fast each thrust may change [N/s], from full ahead on.
        """
        speed, time, way, dt = self.top_speed_mps, 0.0, 0.0, 0.01
        thrust = self.thrusters.max_n
        while speed > 0.0 and time < 120.0:
            thrust = max(self.thrusters.min_n, thrust - rate_nps * dt)
            drag = (self.linear_drag[0] + self.quadratic_drag[0] * speed) * speed
            speed += dt * (2.0 * thrust - drag) / self.plane_inertia[0]
            time, way = time + dt, way + dt * max(speed, 0.0)
        return time, way


@cache
def load_vessel(name: str | Path = DEFAULT) -> VesselDescription:
    """Read a vessel: a shipped one by name, or a file.

    Raises
    ------
    ConfigError
        The file cannot be used, or no such vessel can be; it says which key, value, and why.
    """
    path = shipped("vessels", name)
    table = load(path, VesselFile).vessel
    try:
        return describe(table, key=str(name))
    except ConfigError as error:
        raise ConfigError(str(error), file=path) from error


def describe(table: VesselTable, key: str = "") -> VesselDescription:
    """Complete a vessel by estimates, and refuse what cannot be.

    Raises
    ------
    ConfigError
        Names the key, its value and what is allowed.
    """
    buoyancy, strips = _buoyancy(table)
    waterline = table.waterline_m or strips.immersion
    density = buoyancy.water_density_kgpm3
    parts = table.parts or (_whole(table, waterline),)
    _require_mass(table, parts, buoyancy)
    _require_speed(table, strips, density)
    added = table.added_mass.over(estimate.added_mass(strips, table.mass_kg, density))
    linear, quadratic = _drag(table, strips, parts, added, density)
    thrusters = _thrusters(table)
    described = VesselDescription(
        key=key,
        name=table.name,
        length_m=table.length_m,
        beam_m=table.beam_m,
        mass_kg=table.mass_kg,
        thruster_spacing_m=table.thruster_spacing_m,
        top_speed_mps=table.top_speed_mps,
        hulls=strips.hulls,
        waterline_m=waterline,
        circles_m=table.circles_m or _circles(table.length_m, table.beam_m),
        parts=parts,
        added_mass=added,
        linear_drag=linear,
        quadratic_drag=quadratic,
        buoyancy=buoyancy,
        thrusters=thrusters,
        windage=_windage(table),
        mask=table.mask or _mask(table, thrusters),
        plane=table.plane_model or _plane(table, parts, added, linear, quadratic),
        boxes=(*_hull_boxes(table, strips, waterline), *table.box),
        cylinders=table.cylinder,
        **_sensors(table, waterline),
    )
    _require_drag(described)
    return described


def _buoyancy(table: VesselTable) -> tuple[Buoyancy, Strips]:
    given = table.buoyancy
    hulls = table.hulls or estimate.hulls(table.length_m, table.beam_m)
    length = given.hull_length_m or 0.95 * table.length_m
    density = given.water_density_kgpm3
    radius = given.hull_radius_m or estimate.hull_radius(table.mass_kg, length, density)
    aside, along = estimate.half_spacing(table.beam_m, hulls), length / math.sqrt(12.0)
    points = given.points_m or tuple((x, y, 0.0) for y in (-aside, aside) for x in (along, -along))
    immersion = estimate.immersion(table.mass_kg, length, radius, density)
    strips = Strips(length, radius, float(np.abs(np.array(points)[:, 1]).mean()), immersion, hulls)
    buoyancy = Buoyancy(
        hull_length_m=length,
        hull_radius_m=radius,
        points_per_hull=given.points_per_hull,
        points_B=np.array(points),
        water_density_kgpm3=density,
        gravity_mps2=given.gravity_mps2,
    )
    return buoyancy, strips


def _whole(table: VesselTable, waterline: float) -> Part:
    """Give the whole boat as one part; its centre of gravity lies in the waterline, amidships."""
    estimated = estimate.inertia(table.mass_kg, table.length_m, table.beam_m)
    given = table.inertia
    roll, pitch, yaw = (
        fallback if value is None else value
        for value, fallback in zip(
            (given.roll_kgm2, given.pitch_kgm2, given.yaw_kgm2), estimated, strict=True
        )
    )
    return Part(
        name=table.name,
        mass_kg=table.mass_kg,
        position_m=given.centre_m or (0.0, 0.0, -waterline),
        inertia_kgm2=(roll, pitch, yaw),
    )


def _drag(
    table: VesselTable, strips: Strips, parts: tuple[Part, ...], added: Six, density: float
) -> tuple[Six, Six]:
    surge, square = estimate.surge_drag(2.0 * table.thrust_max_n, table.top_speed_mps)
    sway, yaw = estimate.cross_drag(strips, density)
    slow = estimate.SLOW_SHARE * table.top_speed_mps
    inertia = (
        table.mass_kg + added[2],
        sum(part.inertia_kgm2[0] for part in parts) + added[3],
        sum(part.inertia_kgm2[1] for part in parts) + added[4],
    )
    _, _, heave, roll, pitch, _ = estimate.upright_damping(strips, inertia, density)
    # U / L is the rate of about the tightest turn: there linear and quadratic drag are equal.
    turn = yaw * table.top_speed_mps / table.length_m
    linear = table.linear_drag.over((surge, slow * sway, heave, roll, pitch, turn))
    return linear, table.quadratic_drag.over((square, sway, 0.0, 0.0, 0.0, yaw))


def _thrusters(table: VesselTable) -> Thrusters:
    given, lever = table.thrusters, table.thruster_spacing_m / 2
    left = given.left_m or (-0.45 * table.length_m, -lever, 0.0)
    right = given.right_m or (-0.45 * table.length_m, lever, 0.0)
    if lever <= 0.0:
        raise ConfigError(
            "the thrusters must stand on either side of the centre line: expected greater than 0, "
            f"got {table.thruster_spacing_m:g}",
            key="vessel.thruster_spacing_m",
        )
    if not left[1] < 0.0 < right[1]:
        raise ConfigError(
            "left_m must lie to port (its second number negative) and right_m to starboard, "
            f"got {left[1]:g} and {right[1]:g}",
            key="vessel.thrusters",
        )
    if abs(right[1] - left[1] - table.thruster_spacing_m) > 0.01 * table.thruster_spacing_m:
        raise ConfigError(
            f"left_m and right_m are {right[1] - left[1]:g} m apart; expected "
            f"thruster_spacing_m {table.thruster_spacing_m:g}",
            key="vessel.thrusters",
        )
    _require_curve(table, given.curve)
    return Thrusters(
        positions_B=np.array([left, right]),
        min_n=table.thrust_min_n,
        max_n=table.thrust_max_n,
        curve=given.curve,
        time_constant_s=given.time_constant_s,
        slew_nps=given.slew_nps,
    )


def _windage(table: VesselTable) -> Windage:
    estimated = estimate.windage(table.length_m, table.beam_m)
    given = table.windage.along, table.windage.across, table.windage.yaw
    along, across, yaw = (
        fallback if value is None else value
        for value, fallback in zip(given, estimated, strict=True)
    )
    return Windage(along, across, yaw)


def _mask(table: VesselTable, thrusters: Thrusters) -> MaskTable:
    margin = max(0.05 * table.length_m, 0.1)
    stern = min(-table.length_m / 2, float(thrusters.positions_B[:, 0].min()))
    return MaskTable(
        aft_m=round(stern - margin, 3),
        fore_m=round(table.length_m / 2 + margin, 3),
        half_width_m=round(table.beam_m / 2 + margin, 3),
    )


def _plane(
    table: VesselTable, parts: tuple[Part, ...], added: Six, linear: Six, quadratic: Six
) -> PlaneModel:
    yaw = sum(
        part.inertia_kgm2[2] + part.mass_kg * math.hypot(*part.position_m[:2]) ** 2
        for part in parts
    )
    return PlaneModel(
        mass_kg=table.mass_kg,
        izz=yaw,
        x_udot=-added[0],
        y_vdot=-added[1],
        n_rdot=-added[5],
        x_u=-linear[0],
        y_v=-linear[1],
        n_r=-linear[5],
        x_uu=-quadratic[0],
        y_vv=-quadratic[1],
        n_rr=-quadratic[5],
        length=table.length_m,
        width=table.beam_m,
        thrust_min_n=table.thrust_min_n,
        thrust_max_n=table.thrust_max_n,
        thruster_spacing_m=table.thruster_spacing_m,
    )


def _circles(length: float, beam: float) -> tuple[Circle, ...]:
    """Cover a hull by equal circles, as many as it is longer than broad."""
    count = max(1, round(length / beam))
    radius = round(math.hypot(length / count, beam) / 2, 3)
    return tuple(((i + 0.5) * length / count - length / 2, radius) for i in range(count))


def _hull_boxes(table: VesselTable, strips: Strips, waterline: float) -> tuple[BoxPart, ...]:
    """Give the hulls, and a catamaran's deck, as boxes from the keel to the freeboard."""
    if not table.hull_boxes:
        return ()
    deck = table.freeboard_m or estimate.freeboard(table.length_m)
    height, middle = waterline + deck, -(waterline + deck) / 2
    if strips.hulls == 1:
        size = (table.length_m, table.beam_m, height)
        return (BoxPart(name="hull", centre_m=(0.0, 0.0, middle), size_m=size),)
    width = min(2.0 * strips.half_width, table.beam_m / 2)
    aside = (table.beam_m - width) / 2
    hull = (table.length_m, width, height)
    plate = (0.4 * table.length_m, table.beam_m - 2 * width + 1e-3, max(0.2 * deck, 0.03))
    return (
        BoxPart(name="hull", centre_m=(0.0, -aside, middle), size_m=hull, mirrored=True),
        BoxPart(name="deck", centre_m=(0.0, 0.0, plate[2] / 2 - height), size_m=plate),
    )


def _sensors(table: VesselTable, waterline: float) -> dict[str, Vector]:
    deck = waterline + (table.freeboard_m or estimate.freeboard(table.length_m))
    given, top = table.sensors, deck + estimate.mast(table.length_m)
    return {
        "lidar_m": given.lidar_m or (0.0, 0.0, -top),
        "antenna_m": given.antenna_m or (-0.1 * table.length_m, 0.0, -deck),
        "imu_m": given.imu_m or (0.0, 0.0, -deck),
    }


def _require_mass(table: VesselTable, parts: tuple[Part, ...], buoyancy: Buoyancy) -> None:
    total = sum(part.mass_kg for part in parts)
    if abs(total - table.mass_kg) > 0.01 * table.mass_kg:
        raise ConfigError(
            f"the parts weigh {total:g} kg together, got {table.mass_kg:g}", key="vessel.mass_kg"
        )
    lift = len(buoyancy.points_B) * largest_lift(buoyancy)
    weight = total * buoyancy.gravity_mps2
    if lift <= weight:
        raise ConfigError(
            f"sinks: {lift:.0f} N of lift, {weight:.0f} N of weight", key="vessel.mass_kg"
        )


def _require_speed(table: VesselTable, strips: Strips, density: float) -> None:
    fastest = estimate.fastest(strips, 2.0 * table.thrust_max_n, density)
    if table.top_speed_mps > fastest:
        raise ConfigError(
            f"with 2 x {table.thrust_max_n:g} N a hull of this size cannot go faster than "
            f"{fastest:.1f} m/s: that is its friction alone; got {table.top_speed_mps:g}",
            key="vessel.top_speed_mps",
        )


def _require_drag(vessel: VesselDescription) -> None:
    """Refuse drag that balances full thrust at another speed than the top speed."""
    linear, quadratic, top = vessel.linear_drag[0], vessel.quadratic_drag[0], vessel.top_speed_mps
    force = top * (linear + quadratic * top)
    if not 0.8 <= force / (2.0 * vessel.thrusters.max_n) <= 1.2:
        raise ConfigError(
            f"at {top:g} m/s the drag in surge is {force:.0f} N, full thrust "
            f"{2.0 * vessel.thrusters.max_n:.0f} N: they must agree to 20 %",
            key="vessel.top_speed_mps",
        )


def _require_curve(table: VesselTable, curve: tuple[tuple[float, float], ...]) -> None:
    if not curve:
        return
    commands, thrusts = zip(*curve, strict=True)
    rises = list(thrusts) == sorted(thrusts) and list(commands) == sorted(set(commands))
    ends = ((-1.0, table.thrust_min_n), (1.0, table.thrust_max_n))
    if not rises or (curve[0], curve[-1]) != ends or (0.0, 0.0) not in curve:
        raise ConfigError(
            f"must rise from {list(ends[0])} through [0.0, 0.0] to {list(ends[1])}, "
            f"got {[list(pair) for pair in curve]}",
            key="vessel.thrusters.curve",
        )


def lift_per_area(buoyancy: Buoyancy) -> float:
    """Give the lift [N/m2] of one point for each square metre of its hull's wet section."""
    length = buoyancy.hull_length_m / buoyancy.points_per_hull
    return length * buoyancy.water_density_kgpm3 * buoyancy.gravity_mps2


def largest_lift(buoyancy: Buoyancy) -> float:
    """Give the lift [N] of one point that is immersed by the hull's radius: half a circle."""
    return 0.5 * math.pi * buoyancy.hull_radius_m**2 * lift_per_area(buoyancy)


def _three_digits(value: float) -> float:
    return float(f"{value:.3g}")

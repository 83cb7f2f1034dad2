"""What a runtime's settings become for another hull than the default one.

The defaults are tuned for the default vessel. For another one, each number that depends on the hull
follows from its description: geometry is taken as it is, what was tuned goes by the hull's own
units (`policy.hull_units`). Whatever a configuration file gives, it wins.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from twinscrew.runtime.charts.route import settings_for
from twinscrew.runtime.perception.segmentation import PerceptionSettings
from twinscrew.runtime.perception.sensor import Mount, Sensor
from twinscrew.runtime.policy.hull_units import units_of
from twinscrew.runtime.policy.observation import ObservationSettings
from twinscrew.runtime.policy.risk import RiskSettings
from twinscrew.runtime.safety.assurance import AssuranceSettings, shore_margin_m
from twinscrew.runtime.safety.prediction import close_circles
from twinscrew.runtime.vessel_description import (
    DEFAULT,
    Vector,
    VesselDescription,
    load_vessel,
)

GOAL_SHARE = 0.4
"""[-] A goal is reached within this share of the length: 2 m for 5 m (the authors' code)."""


def goal_radius(length_m: float) -> float:
    """Give how near its goal a hull of a length [m] has to come [m]; GPS asks for 0.5 at least."""
    return max(GOAL_SHARE * length_m, 0.5)


def lidar_on(sensor: Sensor, vessel: VesselDescription) -> Sensor:
    """Put a LiDAR where a vessel carries it; the sensors' own mounts are the default vessel's."""
    if vessel.key == DEFAULT:
        return sensor
    return sensor.mounted(Mount(**_place(vessel.lidar_m)))


def hull_settings(vessel: VesselDescription) -> dict[str, Any]:
    """Give the settings that differ from the defaults, as a configuration file has them."""
    if vessel.key == DEFAULT:
        return {}
    reference = load_vessel()
    units = units_of(vessel, reference)
    length = vessel.length_m / reference.length_m
    range_m = round(PerceptionSettings().max_range_m * max(length, 1.0), 3)  # as many lengths
    return {
        "mount": _place(vessel.lidar_m),
        "risk": {
            "own_radius_m": vessel.radius_m,
            "distance_m": RiskSettings().distance_m * units.length,
        },
        "thrust": {"min_n": vessel.thrusters.min_n, "max_n": vessel.thrusters.max_n},
        "mission": {"goal_radius_m": goal_radius(vessel.length_m)},
        "perception": _perception(vessel, length, range_m),
        "observation": {
            "own_radius_m": vessel.radius_m,
            "perception_range_m": range_m,
            "goal_range_m": ObservationSettings().goal_range_m * units.length,
        },
        "assurance": _assurance(vessel, reference),
        "route": settings_for(vessel),
        "alarms": {"own_radius_m": vessel.radius_m},
        "autopilot": {"paddles": paddles(vessel)},
        "envelope": {"enabled": False},  # the shipped one is what the default vessel was proved for
        "estimation": {
            "sensors": {"antenna": _place(vessel.antenna_m), "imu": _place(vessel.imu_m)}
        },
    }


def paddles(vessel: VesselDescription) -> dict[str, Any]:
    """Give what full paddle means: the thrust range, and the thrust curve."""
    thrusters = vessel.thrusters
    return {
        "ahead_N": thrusters.max_n,
        "astern_N": max(-thrusters.min_n, 1e-3),
        "curve": [list(point) for point in thrusters.curve],
    }


def _place(position_B: Vector) -> dict[str, float]:
    """Turn a place from frame B to forward, port, up, as mounts have it."""
    x, y, z = position_B
    return {"x_m": x, "y_m": 0.0 - y, "z_m": 0.0 - z}


def _perception(vessel: VesselDescription, length: float, range_m: float) -> dict[str, Any]:
    """Look for vessels of the own size; small hulls give few echoes, long ones are one object."""
    mask, tuned = vessel.mask, PerceptionSettings()
    return {
        "max_range_m": range_m,
        "min_points": max(6, round(tuned.min_points * min(length, 1.0))),
        "longest_m": max(tuned.longest_m, 1.16 * 2.0 * vessel.radius_m),
        "footprint": _footprint(vessel),
        "hull": {
            "aft_m": mask.aft_m,
            "fore_m": mask.fore_m,
            "half_width_m": mask.half_width_m,
        },
        "water": {"surface_m": round(vessel.waterline_m, 3)},
    }


def expecting(types: Sequence[str]) -> dict[str, Any]:
    """Give perception's settings among vessels of these types: pieces may be of the largest."""
    largest = max((load_vessel(kind) for kind in types), key=lambda vessel: vessel.length_m)
    return {} if largest.key == DEFAULT else {"footprint": _footprint(largest)}


def _footprint(vessel: VesselDescription) -> dict[str, float]:
    """Give the footprint that pieces of a vessel fit into."""
    return {
        "length_m": 1.1 * vessel.length_m,
        "beam_m": 1.16 * vessel.beam_m,
        "reach_m": 0.88 * vessel.beam_m,
        "least_m": 0.44 * vessel.length_m,
    }


def _assurance(vessel: VesselDescription, reference: VesselDescription) -> dict[str, Any]:
    """Look ahead as much longer as the vessel takes longer to stop than the default one."""
    units = units_of(vessel, reference)
    force, tuned = units.force, AssuranceSettings()
    slew_nps = tuned.slew_nps * force / units.time
    stops_s = vessel.stopping(slew_nps)[0] / reference.stopping(tuned.slew_nps)[0]
    horizon_s = round(tuned.horizon_s * stops_s, 2)
    return {
        "horizon_s": horizon_s,
        "moving_horizon_s": round(tuned.moving_horizon_s * stops_s, 2),
        "step_s": horizon_s / round(tuned.horizon_s / tuned.step_s),
        "wait_s": round(max(tuned.wait_s * stops_s, 0.2), 2),
        "margin_m": round(max(tuned.margin_m * units.length, 0.3), 3),
        "shore_margin_m": shore_margin_m(vessel),
        "approach_per_s": tuned.approach_per_s / units.time,
        "slew_nps": slew_nps,
        "brake_nspm": tuned.brake_nspm * force / units.speed,
        "turn_n": tuned.turn_n * force,
        "disturbance_limit_n": tuned.disturbance_limit_n * force,
        "vessel": {
            "inertia": list(vessel.plane_inertia),
            "linear_drag": [vessel.linear_drag[i] for i in (0, 1, 5)],
            "quadratic_drag": [vessel.quadratic_drag[i] for i in (0, 1, 5)],
            "lever_m": vessel.lever_m,
            "hull": [list(circle) for circle in vessel.circles_m],
            "close_hull": [list(circle) for circle in close_circles(vessel)],
        },
    }

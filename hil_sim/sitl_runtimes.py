"""What each vessel's runtime is told in software in the loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.drivers.processes import LOOPBACK, free_port
from twinscrew.hil_sim.scenario import Scenario, as_chart
from twinscrew.hil_sim.sensors.marine import OWN_MMSI
from twinscrew.hil_sim.sitl_settings import Interface, OdometrySource, SitlSettings
from twinscrew.runtime.bus.zenoh import DEFAULT_PORT, ZenohSettings
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.ground.report import GroundSettings
from twinscrew.runtime.vessel.config import RuntimeConfig, config_for
from twinscrew.runtime.vessel.hull_settings import expecting
from twinscrew.runtime.vessel.trial import room_m
from twinscrew.runtime.vessel_description import DEFAULT, VesselDescription, load_vessel

DATUM = Datum(latitude_deg=Origin().latitude_deg, longitude_deg=Origin().longitude_deg)
"""Where the scenarios' origin lies: the vessels sail in one frame."""
ALL_TOLD = GroundSettings(obstacles_hz=5.0, vessels_hz=1.0, latency_hz=1.0)
"""What a ground station that watches is told."""

_SOURCE: dict[OdometrySource, Literal["bus", "autopilot", "gps_imu"]] = {
    OdometrySource.BUS: "bus",
    OdometrySource.AUTOPILOT: "autopilot",
    OdometrySource.AUTOPILOT_ODOMETRY: "autopilot",
    OdometrySource.GPS_IMU: "gps_imu",
}


def runtime_config(
    settings: SitlSettings, scenario: Scenario, vessel: int, folder: Path | None
) -> RuntimeConfig:
    """Give the configuration of a vessel's runtime, which records to a folder, if any."""
    policy = Path(settings.policy)
    kind = load_vessel(settings.believed or scenario.types[vessel])
    sensors = {} if kind.key != DEFAULT else {"sensors": settings.navigation.place}
    return config_for(
        kind.key,
        name=scenario.names[vessel],
        sensor=settings.sensor,
        policy=str(policy.resolve()) if policy.is_file() else settings.policy,
        odometry_source=_SOURCE[settings.odometry],
        estimation={"datum": DATUM, **sensors},
        chart=as_chart(scenario) if settings.charted else {"from_scenario": False},
        mission={"goal_radius_m": scenario.goal_radius},
        perception=expecting(scenario.types),
        autopilot=_autopilot(settings, vessel),
        trial=_trial(settings, kind),
        senses=_senses(settings, vessel),
        ground=ALL_TOLD if settings.ground else GroundSettings(),
        bus={"key_format": settings.key_format, "domain": settings.domain},
        recording={
            "folder": str(folder or ""),
            "about": {"scenario": scenario.name, "seed": str(settings.seed)},
        },
    )


def _trial(settings: SitlSettings, kind: VesselDescription) -> dict[str, Any]:
    """Give a trial three times the water that it needs: the simulated sea has no shore."""
    if not settings.trial:
        return {}
    around_m = 3.0 * room_m(settings.trial, kind)
    return {"name": settings.trial, "around_m": around_m, "max_time_s": settings.trial_time_s}


def _senses(settings: SitlSettings, vessel: int) -> dict[str, Any]:
    """Give the sensors beside the LiDAR that are simulated."""
    marine, found = settings.marine, {}
    if marine.ais is not None:
        own = OWN_MMSI + vessel if marine.ais.own_vessels else 0
        found["ais"] = {"own_mmsi": own}
    if marine.radar is not None:
        found["radar"] = {}
    return found


def simulator_zenoh(settings: SitlSettings) -> ZenohSettings:
    """Give how the simulator's Zenoh is reached, and whom it reaches.

    Where no router is named it is one: ROS 2's nodes look for `rmw_zenohd` on port 7447.
    """
    vrx = settings.interface is Interface.VRX
    port = settings.zenoh_port
    if port is None:
        port = DEFAULT_PORT if vrx and not settings.zenoh_connect else free_port()
    routes = settings.key_format != "ros2dds" and not settings.zenoh_connect
    return ZenohSettings(
        mode="router" if routes else "peer",
        listen=(f"tcp/{LOOPBACK}:{port or free_port()}",),
        connect=settings.zenoh_connect,
        key_format=settings.key_format,
        domain=settings.domain,
        node="simulator",
    )


def _autopilot(settings: SitlSettings, vessel: int) -> dict[str, Any]:
    whole = settings.odometry is OdometrySource.AUTOPILOT_ODOMETRY
    return {
        "system_id": vessel + 1,
        "arm": True,
        "receiver_fitted": False,
        "write_parameters": settings.write_params,
        "state_message": "odometry" if whole else "local_position",
        "datum": DATUM,
    }

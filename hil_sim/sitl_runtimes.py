"""What each vessel's runtime is told in software in the loop."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.sitl_settings import OdometrySource, SitlSettings
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.ground import GroundSettings
from twinscrew.runtime.app.mission import MissionSettings
from twinscrew.runtime.app.recording_settings import RecordingSettings
from twinscrew.runtime.estimation.estimator import EstimationSettings
from twinscrew.runtime.link.autopilot import AutopilotSettings
from twinscrew.runtime.link.datum import Datum

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
    return RuntimeConfig(
        name=scenario.names[vessel],
        sensor=settings.sensor,
        policy=str(policy.resolve()) if policy.is_file() else settings.policy,
        odometry_source=_SOURCE[settings.odometry],
        estimation=EstimationSettings(datum=DATUM, sensors=settings.navigation.place),
        mission=MissionSettings(goal_radius_m=scenario.goal_radius),
        autopilot=_autopilot(settings, vessel),
        ground=ALL_TOLD if settings.ground else GroundSettings(),
        recording=RecordingSettings(
            folder=str(folder or ""), about={"scenario": scenario.name, "seed": str(settings.seed)}
        ),
    )


def _autopilot(settings: SitlSettings, vessel: int) -> AutopilotSettings:
    whole = settings.odometry is OdometrySource.AUTOPILOT_ODOMETRY
    return AutopilotSettings(
        system_id=vessel + 1,
        arm=True,
        receiver_fitted=False,
        write_parameters=settings.write_params,
        state_message="odometry" if whole else "local_position",
        datum=DATUM,
    )

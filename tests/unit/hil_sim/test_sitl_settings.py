"""Settings that contradict each other are refused before anything is made."""

import pytest

from twinscrew.hil_sim.sitl_settings import AutopilotKind, OdometrySource, SitlSettings, check
from twinscrew.runtime.errors import ConfigError

STATION = "127.0.0.1:14550"
REAL = AutopilotKind.ARDUPILOT


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        (SitlSettings(lockstep=True, ground=STATION), "ground"),
        (SitlSettings(lockstep=True, autopilot=REAL), "autopilot"),
        (SitlSettings(autopilot=REAL, odometry=OdometrySource.AUTOPILOT_ODOMETRY), "odometry"),
        (SitlSettings(processes=True), "processes"),
        (SitlSettings(faults="x", lockstep=True), "faults"),
        (SitlSettings(faults="x", ground=STATION), "faults"),
        (SitlSettings(faults="x", autopilot=REAL), "faults"),
    ],
)
def test_what_does_not_go_together_is_refused_by_its_key(settings: SitlSettings, key: str) -> None:
    with pytest.raises(ConfigError) as refused:
        check(settings)
    assert refused.value.key == key


@pytest.mark.parametrize(
    "settings",
    [
        SitlSettings(),
        SitlSettings(lockstep=True, processes=True),
        SitlSettings(autopilot=REAL, odometry=OdometrySource.AUTOPILOT, ground=STATION),
        SitlSettings(odometry=OdometrySource.AUTOPILOT_ODOMETRY),
        SitlSettings(faults="x"),
    ],
)
def test_what_goes_together_passes(settings: SitlSettings) -> None:
    check(settings)

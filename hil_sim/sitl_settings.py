"""What software in the loop can be told, and what does not go together."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

from msgspec import Meta

from twinscrew.hil_sim.bridges.ardupilot_fleet import ArduPilotSettings
from twinscrew.hil_sim.sensors.marine import MarineSettings
from twinscrew.hil_sim.sensors.navigation import NavigationSettings
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.messages.topics import KeyFormat
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.vessel.trial import TRIALS


class AutopilotKind(Enum):
    """Whose autopilots."""

    TWINSCREW = "twinscrew"
    """Our simulated ones."""
    ARDUPILOT = "ardupilot"
    """A real ArduRover a vessel, whose physics the simulator is."""


class Interface(Enum):
    """What the simulated vessels are to those who drive them."""

    TWINSCREW = "twinscrew"
    """Boats with an autopilot, whose runtimes are started with them."""
    VRX = "vrx"
    """A stand-in of VRX: topics, and nobody aboard. You start what drives them."""


class OdometrySource(Enum):
    """Where the runtimes' odometry comes from."""

    BUS = "bus"
    """The `odometry` topic: what the simulated sensor measures."""
    AUTOPILOT = "autopilot"
    """What the autopilot says of its position, velocity and attitude."""
    AUTOPILOT_ODOMETRY = "autopilot_odometry"
    """The same in one message, ODOMETRY, which ArduPilot does not send."""
    GPS_IMU = "gps_imu"
    """A filter of what a simulated GPS and IMU measure, with VRX's rates and noise."""


class SitlSettings(Settings, frozen=True):
    """What to sail with."""

    sensor: str = "vrx32"
    policy: str = "ac_iqn"
    trial: str = ""
    """A trial that is sailed instead of a voyage to goals; empty: none."""
    trial_time_s: Positive = 1200.0
    """[s] The trial is done after so long."""
    believed: str = ""
    """What the runtimes take the vessels for: a name in config/vessels, or a file. Empty: for what
    they are."""
    charted: bool = True
    """Whether the vessels have the scenario's chart: land, quays, keep-out areas, depths, hazards,
    fences."""
    seed: int = 0
    lockstep: bool = False
    processes: bool = False
    """In lock-step, whether each runtime has a process of its own, led over Zenoh."""
    autopilot: AutopilotKind = AutopilotKind.TWINSCREW
    ardupilot: ArduPilotSettings = ArduPilotSettings()
    odometry: OdometrySource = OdometrySource.BUS
    navigation: NavigationSettings = NavigationSettings()
    """The simulated GPS and IMU; only for `odometry = "gps_imu"`."""
    marine: MarineSettings = MarineSettings()
    """The simulated AIS and radar, which the runtimes then use."""
    faults: str = ""
    """A file of faults, or the name of one in config/faults; empty: none."""
    write_params: bool = False
    """Whether the runtimes write the autopilots' parameters that are not what they must be."""
    interface: Interface = Interface.TWINSCREW
    key_format: KeyFormat = "ros2dds"
    """Whose Zenoh keys simulator and runtimes use."""
    domain: Annotated[int, Meta(ge=0, le=232)] = 0
    """[-] ROS_DOMAIN_ID; rmw_zenoh's keys hold it."""
    zenoh_port: Annotated[int, Meta(ge=0, le=65535)] | None = None
    """Where the simulator's Zenoh listens on this machine; None: 7447 for VRX, else any."""
    zenoh_connect: tuple[str, ...] = ()
    """A router that is there already, as "tcp/127.0.0.1:7447"; none: the simulator is one."""
    ground: str = ""
    """HOST:PORT where a ground station listens for the autopilots (UDP); empty: there is none."""

    @property
    def simulates_autopilots(self) -> bool:
        """Whether the autopilots are ours."""
        return self.autopilot is AutopilotKind.TWINSCREW


def check(settings: SitlSettings) -> None:
    """Refuse what contradicts itself.

    Raises
    ------
    ConfigError
        Names the key and what would do.
    """
    ours = settings.simulates_autopilots
    if settings.lockstep and settings.ground:
        raise ConfigError("a ground station needs real time: without --lockstep", key="ground")
    if settings.lockstep and not ours:
        raise ConfigError("ArduPilot runs in real time only: without --lockstep", key="autopilot")
    if not ours and settings.odometry is OdometrySource.AUTOPILOT_ODOMETRY:
        raise ConfigError("ArduPilot sends no ODOMETRY: autopilot", key="odometry")
    if settings.processes and not settings.lockstep:
        raise ConfigError(
            "in real time each has its process anyway: with --lockstep", key="processes"
        )
    if settings.trial and settings.trial not in (*TRIALS, "all"):
        raise ConfigError(one_of(settings.trial, (*TRIALS, "all")), key="trial")
    if settings.trial and settings.faults:
        raise ConfigError("not together with faults", key="trial")
    if settings.believed and not ours:
        raise ConfigError("only with our autopilots", key="believed")
    zenoh = settings.zenoh_port is not None or settings.zenoh_connect
    if settings.lockstep and (zenoh or settings.key_format != "ros2dds"):
        raise ConfigError("Zenoh joins others in real time only: without --lockstep", key="zenoh")
    if settings.interface is Interface.VRX:
        _check_vrx(settings)
    if settings.faults and (settings.lockstep or settings.ground or not ours):
        raise ConfigError("only in real time, with our autopilots and no station", key="faults")


def _check_vrx(settings: SitlSettings) -> None:
    defaults = SitlSettings()
    for key in (
        "lockstep",
        "trial",
        "believed",
        "autopilot",
        "odometry",
        "write_params",
        "faults",
        "ground",
    ):
        if getattr(settings, key) != getattr(defaults, key):
            words = "has no meaning with --interface vrx: you start what drives the vessels"
            raise ConfigError(words, key=key)

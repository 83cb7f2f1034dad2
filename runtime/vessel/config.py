"""The runtime's configuration: every stage's settings in one file, complete without any.

config/runtime.toml shows every key with its default, unit and meaning.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from twinscrew.runtime.bus.zenoh import ZenohSettings
from twinscrew.runtime.charts.chart import ChartSettings
from twinscrew.runtime.charts.learnt import LearntSettings
from twinscrew.runtime.charts.route import RouteSettings
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.estimation.estimator import EstimationSettings
from twinscrew.runtime.ground.report import GroundSettings
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.link.autopilot import topics_of
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.perception.segmentation import PerceptionSettings
from twinscrew.runtime.perception.sensor import Mount, Sensor, load_sensor
from twinscrew.runtime.policy.observation import ObservationSettings
from twinscrew.runtime.policy.risk import RiskSettings
from twinscrew.runtime.recording.settings import RecordingSettings
from twinscrew.runtime.safety.alarms import AlarmSettings
from twinscrew.runtime.safety.assurance import AssuranceSettings
from twinscrew.runtime.safety.envelope import EnvelopeSettings
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.senses.table import SensesSettings, fitted, sense_topics, sources_of
from twinscrew.runtime.settings import CONFIG_DIR, Settings, convert, read_toml
from twinscrew.runtime.tracking.tracker import TrackerSettings
from twinscrew.runtime.vessel.frames import FrameSettings
from twinscrew.runtime.vessel.hull_settings import hull_settings
from twinscrew.runtime.vessel.inputs import AlignmentSettings, OdometryBufferSettings
from twinscrew.runtime.vessel.mission import MissionSettings
from twinscrew.runtime.vessel.process import PrioritySettings
from twinscrew.runtime.vessel.station import StationSettings
from twinscrew.runtime.vessel.trial import TrialSettings
from twinscrew.runtime.vessel_description import DEFAULT, load_vessel

SENSED: Final = tuple(topic.name for topic in TOPICS.values() if topic.taken == "gps_imu")
"""The topics that odometry is made of, with `odometry_source = "gps_imu"`."""


class IntegritySettings(Settings, frozen=True):
    """Whether the files that are read must be approved ones (docs/security.md)."""

    manifest: str = ""
    """A manifest (`twinscrew manifest write`): every file that is read must agree with it. Empty:
    none. `run --manifest` says so beyond the reach of whoever can change this file."""
    public_key: str = ""
    """The manifest must be signed with this minisign key; others must not be able to change it."""


class RuntimeConfig(Settings, frozen=True):
    """One vessel's runtime."""

    name: str = "wamv"
    """The vessel's namespace: its topics are `<name>/sensors/...`."""
    vessel: str = DEFAULT
    """What the vessel is: a name in config/vessels, or a file. Settings that depend on the hull and
    are not given follow it (docs/vessels.md)."""
    sensor: str = "vrx32"
    """The LiDAR: a name in config/sensors, or a file."""
    mount: Mount | None = None
    """Where the LiDAR sits, x_m, y_m, z_m (forward, port, up from the vessel's origin) and
    roll_rad, pitch_rad, yaw_rad; none takes the sensor's own description's."""
    policy: str = "ac_iqn"
    """A name in config/policies, an ONNX file, "apf", "mpc", "orca" or "sbmpc"."""
    risk: RiskSettings = RiskSettings()
    odometry_source: Literal["bus", "autopilot", "gps_imu"] = "bus"
    """Where odometry comes from: the `odometry` topic, the autopilot's own estimate, or a filter
    here of the `gps` and `imu` topics."""
    command_rate_hz: Annotated[float, Meta(ge=20.0, le=1000.0)] = 20.0
    """[Hz] The thrust is re-sent, and the inputs' ages looked at, this often (parameters.md:
    20 Hz). Less often, neutral would not come within half a second of an input's loss."""
    thrust: ThrustLimits = ThrustLimits()
    mission: MissionSettings = MissionSettings()
    station: StationSettings = StationSettings()
    trial: TrialSettings = TrialSettings()
    perception: PerceptionSettings = PerceptionSettings()
    tracking: TrackerSettings = TrackerSettings()
    senses: SensesSettings = SensesSettings()
    alarms: AlarmSettings = AlarmSettings()
    observation: ObservationSettings = ObservationSettings()
    assurance: AssuranceSettings = AssuranceSettings()
    envelope: EnvelopeSettings = EnvelopeSettings()
    odometry: OdometryBufferSettings = OdometryBufferSettings()
    alignment: AlignmentSettings = AlignmentSettings()
    frames: FrameSettings = FrameSettings()
    estimation: EstimationSettings = EstimationSettings()
    bus: ZenohSettings = ZenohSettings()
    autopilot: AutopilotSettings = AutopilotSettings()
    chart: ChartSettings = ChartSettings()
    route: RouteSettings = RouteSettings()
    learnt: LearntSettings = LearntSettings()
    ground: GroundSettings = GroundSettings()
    priority: PrioritySettings = PrioritySettings()
    recording: RecordingSettings = RecordingSettings()
    integrity: IntegritySettings = IntegritySettings()

    def __post_init__(self) -> None:
        """Refuse thrust limits that the autopilot's paddles cannot ask for."""
        paddles = self.autopilot.paddles
        if not -paddles.astern_N <= self.thrust.min_n <= 0.0 <= self.thrust.max_n:
            raise ValueError(f"thrust.min_n must be in [{-paddles.astern_N:g}, 0] N")
        if self.thrust.max_n > paddles.ahead_N:
            raise ValueError(f"thrust.max_n must be in [0, {paddles.ahead_N:g}] N")
        if self.autopilot.kind == "thrust":
            _check_thrust(self)
        if self.ground.vessels_hz > 0.0 and self.autopilot.datum is None:
            raise ValueError("ground.vessels_hz needs autopilot.datum: vessels lie on the earth")
        if self.senses.ais is not None and datum_of(self) is None:
            raise ValueError("senses.ais needs a datum: [senses.ais], [autopilot] or [estimation]")
        if self.chart.file and datum_of(self) is None:
            raise ValueError("chart.file needs [autopilot.datum]: it lies on the earth")
        if self.senses.nmea.connections and "nmea" not in sense_topics(self.senses):
            raise ValueError("senses.nmea.connections needs [senses.ais] or [senses.ttm]")


def _check_thrust(config: RuntimeConfig) -> None:
    """Refuse what thrusters that are commanded by topic cannot do."""
    if config.odometry_source == "autopilot":
        allowed = "bus, gps_imu"
        raise ValueError(f"odometry_source: thrusters tell no odometry; allowed are {allowed}")
    bus = config.bus
    if not (bus.connect or bus.config_file or bus.multicast_scouting):
        raise ValueError(
            "bus.connect: with autopilot.kind = 'thrust' the thrusters must be reached by a second "
            "process, too, that stops them when this one cannot: name a simulator or router"
        )


def inputs_of(config: RuntimeConfig) -> tuple[str, ...]:
    """Give the topics that a runtime listens to."""
    when = ("always", config.odometry_source)
    taken = (topic.name for topic in TOPICS.values() if topic.taken in when)
    others = sense_topics(config.senses)
    return (*taken, *topics_of(config.autopilot.kind), *others)


def datum_of(config: RuntimeConfig) -> Datum | None:
    """Give the place of the local frame on the earth; None if nothing says it."""
    ais = config.senses.ais
    told = None if ais is None else ais.datum
    return told or config.autopilot.datum or config.estimation.datum


def senses_of(config: RuntimeConfig) -> SensesSettings:
    """Give the sensors beside the LiDAR, with the datum of the vessel."""
    ais = config.senses.ais
    if ais is None:
        return config.senses
    return replace(config.senses, ais=replace(ais, datum=datum_of(config)))


def tracking_of(config: RuntimeConfig) -> TrackerSettings:
    """Give the tracker's settings, with what it must know of each sensor that is there."""
    if not fitted(config.senses):
        return config.tracking
    sources = sources_of(config.senses, config.tracking.sources)
    return replace(config.tracking, sources=sources)


def sensor_of(config: RuntimeConfig) -> Sensor:
    """Give the configured LiDAR at its configured place.

    Raises
    ------
    ConfigError
        There is no such sensor, or nothing says where it sits.
    """
    sensor = load_sensor(config.sensor)
    return sensor if config.mount is None else sensor.mounted(config.mount)


def autopilot_of(config: RuntimeConfig) -> AutopilotSettings:
    """Give the link's settings: as configured, and asking for odometry if it is the source."""
    settings = config.autopilot
    if config.odometry_source != "autopilot" or settings.state_hz > 0.0:
        return settings
    return replace(settings, state_hz=TOPICS["odometry"].rate_hz)


def load_config(path: Path, vessel: str | None = None) -> RuntimeConfig:
    """Read a runtime's configuration, with the settings of its vessel where it gives none.

    Parameters
    ----------
    path
        The TOML file.
    vessel
        What the vessel is, whatever the file says.

    Raises
    ------
    ConfigError
        Says what in it cannot be used.
    """
    values = read_toml(path)
    if vessel is not None:
        values["vessel"] = vessel
    return _following(values, path)


def config_for(vessel: str, **given: Any) -> RuntimeConfig:
    """Give a vessel's configuration: what is given, and else what follows its hull.

    Tables are given as dictionaries, with only those keys that are meant.
    """
    return _following({"vessel": vessel, **msgspec.to_builtins(given)}, None)


def _following(values: dict[str, Any], file: Path | None) -> RuntimeConfig:
    try:
        vessel = load_vessel(str(values.get("vessel", DEFAULT)))
    except ConfigError as error:
        raise ConfigError(str(error), file=file, key="vessel") from error
    values = {**values, **_envelope_of(values, file)}
    return convert(_merged(hull_settings(vessel), values), RuntimeConfig, file=file)


def _envelope_of(values: dict[str, Any], file: Path | None) -> dict[str, Any]:
    """Read the operational envelope where a file of it is named; paths count from `file`.

    One that is given, as a table or a file, is meant, whatever the hull, unless it says otherwise.
    """
    named = values.get("envelope")
    if isinstance(named, dict):
        return {"envelope": {"enabled": True, **named}}
    if not isinstance(named, str):
        return {}
    here = Path() if file is None else file.parent
    path = CONFIG_DIR / "envelope.toml" if named == "envelope" else here / named
    content = read_toml(path)
    convert(content, EnvelopeSettings, file=path)  # errors name the file in which they are
    return {"envelope": {"enabled": True, **content}}


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Lay one tree of tables over another."""
    both = {key: (below[key], value) for key, value in above.items() if key in below}
    return {
        **below,
        **above,
        **{
            key: _merged(low, high)
            for key, (low, high) in both.items()
            if isinstance(low, dict) and isinstance(high, dict)
        },
    }

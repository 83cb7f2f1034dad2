"""The one table of topics, and the definitions of their ROS types."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from twinscrew.runtime.errors import BusError, MessageError, one_of
from twinscrew.runtime.messages import marine
from twinscrew.runtime.messages.decision import DECISION_TYPE, EXPLANATION_TYPE
from twinscrew.runtime.messages.navigation import (
    CHART_TYPE,
    CLOCK_TYPE,
    ENABLE_TYPE,
    ENGAGEMENT_TYPE,
    FALLBACK_TYPE,
    FIX_TYPE,
    GOAL_TYPE,
    IMU_TYPE,
    ODOMETRY_TYPE,
    PATH_TYPE,
    THRUST_TYPE,
)
from twinscrew.runtime.messages.point_cloud import POINT_CLOUD_TYPE
from twinscrew.runtime.messages.visual import DIAGNOSTICS_TYPE, MARKERS_TYPE, TRANSFORMS_TYPE

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


# -- Definitions of the ROS types: our own here, the standard ones from `rosbags`.
#
# They are needed where a recording names its types, and for rmw_zenoh's keys; not on the way of the
# data. Loading them takes some 0.1 s, so that happens at the first use.


OWN: Final = {
    "twinscrew_msgs/msg/Engagement": """
# Whether thrust commands may act.
builtin_interfaces/Time stamp
bool engaged
""",
    "twinscrew_msgs/msg/Fallback": """
# What the boat does because it is outside its operational envelope.
uint8 NONE=0
uint8 SLOW=1
uint8 HOLD=2
uint8 STOP=3
uint8 HAND_OVER=4
builtin_interfaces/Time stamp
uint8 response
string reason
""",
    "twinscrew_msgs/msg/Ring": """
float64[] places # M times north, east [m]
""",
    "twinscrew_msgs/msg/ChartFeature": """
# An area or a circle in which, or outside of which, a boat must not be.
uint8 LAND=0
uint8 KEEP_OUT=1
uint8 DEPTH=2
uint8 HAZARD=3
uint8 FENCE=4
uint8 kind
bool keep_in      # an inclusion fence: forbidden outside
float64 depth_m   # least depth, for DEPTH; -inf: not known
float64 radius_m  # of a circle; 0: an area
string name
float64[] outline # M times north, east [m]; a circle: its centre
twinscrew_msgs/Ring[] holes
""",
    "twinscrew_msgs/msg/Chart": """
# All that is fixed around the boat. Frame: local north, east.
builtin_interfaces/Time stamp
float64 safety_depth_m # water of less depth is forbidden
twinscrew_msgs/ChartFeature[] features
""",
    "twinscrew_msgs/msg/HealthEvent": """
uint8 INFO=0
uint8 WARNING=1
uint8 ERROR=2
builtin_interfaces/Time stamp
string name
uint8 severity
string detail
""",
    "twinscrew_msgs/msg/Observation": """
# What a policy saw; zeros if it was not asked. Frame: forward, starboard of the vessel, levelled.
float32[7] ego      # goal x, y [m], surge, sway [m/s], yaw rate [rad/s], left, right thrust [N]
float32[25] objects # five times x, y [m], vx, vy [m/s], radius [m]
float32[5] mask     # 1 where there is an object
""",
    "twinscrew_msgs/msg/Objects": """
# What perception found in a scan.
builtin_interfaces/Time stamp
float64[] p_b     # K times forward, starboard [m]
float64[] radius  # K times [m]
int64[] points    # K times
""",
    "twinscrew_msgs/msg/Tracks": """
# What the tracker believes. Frame: local north, east.
builtin_interfaces/Time stamp
int64[] id
float64[] p_n        # K times north, east [m]
float64[] v_n        # K times north, east [m/s]
float64[] radius     # K times [m]
float64[] covariance # K times 4 x 4 of north, east, v_north, v_east
float64[] age_s      # K times: since it was last seen
""",
    "twinscrew_msgs/msg/Decision": """
# What the core decided on one scan, with everything it saw.
builtin_interfaces/Time stamp
uint64 sequence
bool acted           # the policy was asked
bool arrived
bool observed        # the observation holds something
float64[2] thrust_rate # left, right [N/s]
float64[2] thrust      # left, right [N]
twinscrew_msgs/Observation observation
twinscrew_msgs/Objects objects
twinscrew_msgs/Tracks tracks
twinscrew_msgs/HealthEvent[] events
""",
    "twinscrew_msgs/msg/Explanation": """
# What the vessel is doing and why, of the decision with the same sequence.
builtin_interfaces/Time stamp
uint64 sequence
string sentence
int64 track     # that it is about; -1: none
uint8 rule      # of the COLREGs between the two: 14, 15, 17 (stand on); 0: none
float64 cpa_m   # least distance to the track's surface on present courses [m]; NaN: none
float64 tcpa_s  # when [s]; NaN: none
""",
}
"""Our own types in ROS's definition language, by name."""


@lru_cache(maxsize=1)
def type_store() -> Typestore:
    """Give rosbags' store of ROS 2 Jazzy's types with ours added."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for name, text in (marine.DEFINITIONS | OWN).items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


@lru_cache
def definition(ros_type: str) -> str:
    """Give a type's definition with those of the types it is made of, as a recording holds it."""
    _check_known(ros_type)
    text, _ = type_store().generate_msgdef(ros_type, ros_version=2)
    return text


@lru_cache
def type_hash(ros_type: str) -> str:
    """Give a type's hash, ``RIHS01_...`` (ROS REP 2016)."""
    _check_known(ros_type)
    return type_store().hash_rihs01(ros_type)


def _check_known(ros_type: str) -> None:
    if ros_type not in type_store().fielddefs:
        raise MessageError(f"no definition of the ROS type {ros_type!r}")


# -- The one table of topics: the bus, the health monitor, the recorder and the tests read it.

SMALL_B: Final = 16_384
"""[B] The most of a message without lists: ten times the largest, an Odometry with two frames of
255 letters. What is larger is no such message, and would be copied and recorded all the same."""
ROUTE_B: Final = 2_000_000
"""[B] The most of a route: 4096 places, each with a frame of 255 letters, have 1.4 MB."""

CHART_B: Final = 8_000_000
"""[B] The most of a chart: 50 000 features of a vertex and a name of 60 letters have 6 MB."""

KeyFormat: TypeAlias = Literal["ros2dds", "rmw_zenoh", "rmw_zenoh_humble"]
KEY_FORMATS: Final[tuple[KeyFormat, ...]] = ("ros2dds", "rmw_zenoh", "rmw_zenoh_humble")
NO_HASH: Final = "TypeHashNotSupported"
"""What stands in the place of a type's hash in the keys of Humble's rmw_zenoh: Humble has none."""


class Direction(Enum):
    """Which way a topic goes, seen from the runtime."""

    IN = "in"
    OUT = "out"


class Traffic(Enum):
    """How the bus treats a topic when it has to choose."""

    SENSOR = "sensor"
    """Large and frequent: the newest counts, an old one may be lost."""
    COMMAND = "command"
    """Small and urgent: sent at once, before everything else."""
    STATUS = "status"
    """For people and logs: last in line."""


@dataclass(frozen=True, slots=True)
class Topic:
    """One line of the table."""

    name: str
    """What the code calls it."""
    key: str
    """Its ROS name under the vessel's namespace; absolute if it begins with a slash."""
    ros_type: str
    """The ROS type of its messages."""
    direction: Direction
    traffic: Traffic
    rate_hz: float = 0.0
    """[Hz] How often it comes; 0: when something changes."""
    max_age_s: float | None = None
    """[s] Older than this it is stale; None: it never is."""
    depth: int = 1
    """[-] How many unread messages are kept, the newest ones."""
    largest_b: int | None = None
    """[B] Larger messages are thrown away unread; None: the bus's `max_message_mb` alone counts."""
    durable: bool = False
    """True if ROS 2 expects it to reach late listeners (transient local): it is given again and
    again, and announced as such."""
    taken: str = ""
    """When a runtime listens to it: "always", or with this `odometry_source`; empty: never, or only
    where a kind of autopilot or a sensor asks for it. What is taken in is recorded, and so is what
    is published."""
    stale: str = ""
    """The event that is told when it is older than `max_age_s`; empty: nobody watches it."""
    core: bool = False
    """True if decisions depend on it: a recording of these topics is enough for a replay."""


IN, OUT = Direction
SENSOR, COMMAND, STATUS = Traffic

# fmt: off
_TABLE: Final = (
    Topic("points", "sensors/lidars/lidar_wamv_sensor/points", POINT_CLOUD_TYPE, IN, SENSOR,
          taken="always", stale="lidar_stale", rate_hz=10.0, max_age_s=0.4, core=True),
    Topic("odometry", "sensors/position/ground_truth_odometry", ODOMETRY_TYPE, IN, SENSOR,
          taken="bus", stale="odometry_stale", rate_hz=20.0, max_age_s=0.3, depth=64,
          largest_b=SMALL_B, core=True),
    Topic("gps", "sensors/gps/gps/fix", FIX_TYPE, IN, SENSOR,
          taken="gps_imu", rate_hz=20.0, depth=32, largest_b=SMALL_B),
    Topic("imu", "sensors/imu/imu/data", IMU_TYPE, IN, SENSOR,
          taken="gps_imu", rate_hz=100.0, depth=128, largest_b=SMALL_B),
    Topic("goal", "goal", GOAL_TYPE, IN, COMMAND, taken="always", largest_b=SMALL_B, core=True),
    Topic("route", "route", PATH_TYPE, IN, COMMAND, taken="always", largest_b=ROUTE_B, core=True),
    Topic("hold", "hold", GOAL_TYPE, IN, COMMAND, taken="always", largest_b=SMALL_B, core=True),
    Topic("berth", "berth", PATH_TYPE, IN, COMMAND, taken="always", largest_b=SMALL_B, core=True),
    Topic("enable", "enable", ENABLE_TYPE, IN, COMMAND, depth=64, largest_b=SMALL_B),
    Topic("engagement", "engagement", ENGAGEMENT_TYPE, OUT, STATUS,
          depth=8, largest_b=SMALL_B, core=True),
    Topic("fallback", "fallback", FALLBACK_TYPE, OUT, STATUS,
          depth=8, largest_b=SMALL_B, core=True),
    Topic("chart", "chart", CHART_TYPE, OUT, STATUS, largest_b=CHART_B, core=True),
    Topic("nmea", "sensors/nmea/sentence", marine.SENTENCE_TYPE, IN, COMMAND,
          depth=512, largest_b=1024, core=True),
    Topic("radar", "sensors/radar/scan", marine.RADAR_TYPE, IN, SENSOR,
          depth=4, largest_b=500000, core=True),
    Topic("clock", "/clock", CLOCK_TYPE, IN, SENSOR, rate_hz=20.0, largest_b=SMALL_B),
    Topic("thrust_left", "thrusters/left/thrust", THRUST_TYPE, OUT, COMMAND,
          rate_hz=20.0, max_age_s=0.5, largest_b=SMALL_B),
    Topic("thrust_right", "thrusters/right/thrust", THRUST_TYPE, OUT, COMMAND,
          rate_hz=20.0, max_age_s=0.5, largest_b=SMALL_B),
    Topic("pwm_left", "thrusters/left/pwm", THRUST_TYPE, OUT, STATUS,
          rate_hz=10.0, largest_b=SMALL_B),
    Topic("pwm_right", "thrusters/right/pwm", THRUST_TYPE, OUT, STATUS,
          rate_hz=10.0, largest_b=SMALL_B),
    Topic("decision", "decision", DECISION_TYPE, OUT, STATUS, rate_hz=10.0, depth=64),
    Topic("explanation", "explanation", EXPLANATION_TYPE, OUT, STATUS, rate_hz=10.0),
    Topic("objects", "perception/objects", MARKERS_TYPE, OUT, STATUS, rate_hz=10.0),
    Topic("tracks", "tracking/tracks", MARKERS_TYPE, OUT, STATUS, rate_hz=10.0),
    Topic("detections", "tracking/detections", marine.DETECTIONS_TYPE, OUT, STATUS, rate_hz=10.0),
    Topic("ais_targets", "ais/targets", marine.DETECTIONS_TYPE, OUT, STATUS, rate_hz=1.0),
    Topic("situation", "situation", MARKERS_TYPE, OUT, STATUS, rate_hz=2.0),
    Topic("path", "path", PATH_TYPE, OUT, STATUS, rate_hz=1.0),
    Topic("planned_route", "planned_route", PATH_TYPE, OUT, STATUS, rate_hz=1.0),
    Topic("transforms", "/tf", TRANSFORMS_TYPE, OUT, STATUS, rate_hz=20.0),
    Topic("static_transforms", "/tf_static", TRANSFORMS_TYPE, OUT, STATUS,
          rate_hz=1.0, durable=True),
    Topic("diagnostics", "diagnostics", DIAGNOSTICS_TYPE, OUT, STATUS, rate_hz=1.0, depth=64),
)
# fmt: on
TOPICS: Final[Mapping[str, Topic]] = MappingProxyType({topic.name: topic for topic in _TABLE})
"""Every topic by its name. Names, types and rates: VRX 2.3.2; ages and depths: our own choice."""

CORE_INPUTS: Final = tuple(topic.name for topic in TOPICS.values() if topic.core)
"""The topics that decide what the core decides."""

_NAMESPACE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


def ros_name(topic: Topic, namespace: str) -> str:
    """Give a topic's name in ROS, as "/wamv1/goal".

    Raises
    ------
    BusError
        The namespace is not one that ROS allows.
    """
    if not _NAMESPACE.fullmatch(namespace):
        raise BusError(f"{namespace!r} is not a namespace: letters, digits, _ and / between names")
    return topic.key if topic.key.startswith("/") else f"/{namespace}/{topic.key}"


def key(topic: Topic, namespace: str, key_format: KeyFormat = "ros2dds", *, domain: int = 0) -> str:
    """Give a topic's Zenoh key.

    Parameters
    ----------
    namespace
        The vessel's, as "wamv1".
    key_format
        Whose keys: those of zenoh-bridge-ros2dds, those of rmw_zenoh, or those of rmw_zenoh as of
        ROS 2 Humble, which have no type hashes.
    domain
        [-] ROS_DOMAIN_ID; part of rmw_zenoh's keys only.

    Raises
    ------
    BusError
        The namespace or the format does not exist.
    """
    name = ros_name(topic, namespace).removeprefix("/")
    if key_format == "ros2dds":
        return name
    if key_format not in KEY_FORMATS:
        raise BusError(f"key format {one_of(key_format, KEY_FORMATS)}")
    return f"{domain}/{name}/{rmw_type(topic, key_format)}"


def rmw_type(topic: Topic, key_format: KeyFormat) -> str:
    """Give a topic's type and its hash as rmw_zenoh's keys and tokens name them."""
    package, _, last = topic.ros_type.split("/")
    hashed = NO_HASH if key_format == "rmw_zenoh_humble" else type_hash(topic.ros_type)
    return f"{package}::msg::dds_::{last}_/{hashed}"

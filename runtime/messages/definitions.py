"""Definitions of the ROS types: our own here, the standard ones from `rosbags`.

They are needed where a recording names its types, and for rmw_zenoh's keys; not on the way of the
data. Loading them takes some 0.1 s, so that happens at the first use.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Final

from twinscrew.runtime.errors import MessageError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

OWN: Final = {
    "twinscrew_msgs/msg/Engagement": """
# Whether thrust commands may act.
builtin_interfaces/Time stamp
bool engaged
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
    for name, text in OWN.items():
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

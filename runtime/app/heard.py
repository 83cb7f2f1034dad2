"""What the doctor says of what it has heard: rates and ages, stamps, layouts, frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from twinscrew.runtime.app.finding import Finding, fail, ok, warn
from twinscrew.runtime.app.motion import judge_motion
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import euler_from_quaternion
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.vessel.config import RuntimeConfig, sensor_of

M = TypeVar("M")
SLOW_SHARE = 0.7
"""[-] A topic slower than this share of its rate is worth a warning."""
FITTING_SHARE = 0.9
"""[-] Fewer points than this share on the described beams: it is another sensor."""
APART_S = 0.1
"""[s] Scans and odometry whose stamps differ by more than this, and more than their ages explain,
come from clocks that disagree: at 3 m/s the world is 0.3 m off."""
FOREIGN_S = 5.0
"""[s] Stamps this far from the time of day count something else: since a start, or simulated."""


class Heard(NamedTuple):
    """One message as it came."""

    payload: bytes
    """Empty for one that is not the newest, but of odometry (`traffic.keep`)."""
    came_s: float
    """[s] Monotonic clock."""
    age_s: float | None
    """[s] Time of day at its arrival less its stamp; None if it has none."""


def judge_content(heard: Mapping[str, Sequence[Heard]], config: RuntimeConfig) -> list[Finding]:
    """Judge what the messages say."""
    newest = {topic: messages[-1].payload for topic, messages in heard.items() if messages}
    findings = [judge_clocks(heard), judge_layout(newest, config)]
    if "odometry" in heard or config.odometry_source != "gps_imu":
        odometry = [message.payload for message in heard.get("odometry", ())]
        findings += [judge_attitude(newest), judge_motion(odometry)]
    return findings


def judge_rate(topic: str, heard: Sequence[Heard], seconds: float) -> Finding:
    """Judge how often a topic comes, and its longest silence."""
    if not heard:
        return fail(topic, "nothing came", "check the key, namespace and bridge")
    expected, rate_hz = TOPICS[topic].rate_hz, len(heard) / seconds
    silence_s = max(np.diff([message.came_s for message in heard]), default=0.0)
    found = f"{rate_hz:.1f} Hz, expected {expected:g} Hz; longest silence {silence_s:.2f} s"
    ages = [message.age_s for message in heard if message.age_s is not None]
    if ages and abs(np.median(ages)) < FOREIGN_S:
        found += f"; age {1e3 * np.median(ages):.0f} ms, at most {1e3 * max(ages):.0f}"
    stale_s = TOPICS[topic].max_age_s
    if rate_hz < SLOW_SHARE * expected or (stale_s is not None and silence_s > stale_s):
        return warn(topic, found, "look for a slow link or a busy machine")
    return ok(topic, found)


def judge_clocks(heard: Mapping[str, Sequence[Heard]]) -> Finding:
    """Judge whether scans and odometry are stamped by clocks that agree."""
    ages = {
        topic: float(np.median(known))
        for topic, messages in heard.items()
        if (known := [message.age_s for message in messages if message.age_s is not None])
    }
    if "points" not in ages or len(ages) < 2:
        return warn("stamps", "scans and odometry did not both come", "see the lines above")
    others = {topic: age for topic, age in ages.items() if topic != "points"}
    topic, age_s = max(others.items(), key=lambda item: abs(item[1] - ages["points"]))
    apart_s = ages["points"] - age_s
    found = f"scans are stamped {1e3 * apart_s:.0f} ms before {topic} that comes with them"
    if abs(apart_s) > FOREIGN_S:
        return fail("stamps", found, "one driver stamps with another clock: set both to one")
    if abs(apart_s) > APART_S + 1.0 / TOPICS["points"].rate_hz:
        return warn("stamps", found, "bring the clocks together (PTP, chrony), or find the delay")
    if abs(ages["points"]) > FOREIGN_S:
        return ok("stamps", f"{found}; they are not the time of day")
    return ok("stamps", found)


def judge_layout(newest: Mapping[str, bytes], config: RuntimeConfig) -> Finding:
    """Compare a cloud with the sensor's description."""
    what = "cloud and sensor"
    cloud = _decoded(newest, "points", cdr.decode_point_cloud)
    if isinstance(cloud, str):
        return fail(what, cloud, "a PointCloud2 with x, y, z is needed")
    perception = Perception(sensor_of(config), config.perception)
    report = perception.project(cloud, np.array([1.0, 0.0, 0.0, 0.0]))
    measured = report.points - report.empty
    fitting = 1.0 - report.no_beam / measured if measured else 1.0
    found = f"{report.points} points, {100 * fitting:.0f} % on the beams of {config.sensor}"
    if fitting < FITTING_SHARE:
        return fail(what, found, "choose or write the sensor's description")
    return ok(what, found)


def judge_attitude(newest: Mapping[str, bytes]) -> Finding:
    """Look whether odometry is plausible: upright, and not faster than a boat."""
    what = "odometry's attitude"
    odometry = _decoded(newest, "odometry", cdr.decode_odometry)
    if isinstance(odometry, str):
        return fail(what, odometry, "a nav_msgs/Odometry is needed")
    roll, pitch, yaw = np.degrees(euler_from_quaternion(odometry.q_NB))
    speed = float(np.hypot(*odometry.velocity_B[:2]))
    found = f"heading {yaw % 360:.0f} deg, roll {roll:.0f}, pitch {pitch:.0f}, {speed:.1f} m/s"
    if max(abs(roll), abs(pitch)) > 45:
        return fail(what, found, "the boat lies on its side: frames are mixed up")
    return ok(what, found)


def _decoded(newest: Mapping[str, bytes], topic: str, decode: Callable[[bytes], M]) -> M | str:
    if topic not in newest:
        return "nothing came"
    try:
        return decode(newest[topic])
    except MessageError as error:
        return str(error)

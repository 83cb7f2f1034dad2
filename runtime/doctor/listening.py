"""What comes in from a running boat: listens to the topics and to the autopilot for a while."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple, TypeVar

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from twinscrew.runtime.bus.base import Inbox, Received
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.doctor.checks import Finding, fail, ok, warn
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.estimation.estimator import Estimator
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_from_quaternion
from twinscrew.runtime.link.ardupilot.authority import AskManual
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.link.ardupilot.parameters import ParameterState
from twinscrew.runtime.link.autopilot import Autopilot, make_autopilot
from twinscrew.runtime.mavlink import Refusal
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import read_stamp
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.messages.wire import Reader
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.vessel.config import (
    SENSED,
    RuntimeConfig,
    autopilot_of,
    inputs_of,
    sensor_of,
)

ODOMETRY_BYTES = 4096
"""[B] More of an odometry message is not kept: whole ones have some 700."""


def listen(config: RuntimeConfig, seconds: float, *, write_params: bool = False) -> list[Finding]:
    """Listen for a while, and say what came; the boat is neither armed nor commanded.

    Parameters
    ----------
    seconds
        [s] How long.
    write_params
        Write the autopilot's parameters that are wrong.
    """
    inbox = Inbox()
    bus = ZenohBus(config.bus, config.name)
    heard: dict[str, list[Heard]] = defaultdict(list)  # see `keep`
    own = config.odometry_source == "autopilot"
    link = make_autopilot(
        replace(
            autopilot_of(config),
            arm=False,
            ask_manual=AskManual.NEVER,
            write_parameters=write_params,
        )
    )
    transport = link.open(lambda: True)
    estimate = Estimator(config.estimation) if config.odometry_source == "gps_imu" else None
    topics = tuple(topic for topic in inputs_of(config) if TOPICS[topic].rate_hz > 0)
    try:
        inbox.listen(bus, topics)
        until_s = time.monotonic() + seconds
        while (now_s := time.monotonic()) < until_s:
            for message in inbox.wait(0.05):
                keep(heard[message.topic], message.topic, _heard(message, time.monotonic()))
                _estimate(estimate, message, heard)
            link.receive(transport.receive(), now_s)
            for odometry in link.take_odometry() if own else ():
                heard["odometry"].append(Heard(cdr.encode_odometry(odometry), now_s, None))
            transport.send(link.command(None, now_s) + link.tick(now_s))
    finally:
        bus.close()
        transport.close()
    rated = topics if "odometry" in topics else (*topics, "odometry")
    findings = [judge_rate(topic, heard[topic], seconds) for topic in rated]
    return [*findings, *judge_content(heard, config), *judge_autopilot(link)]


def keep(heard: list[Heard], topic: str, new: Heard) -> None:
    """Add a message to those of its topic, of which only what will be looked at is kept.

    That is when each one came, the newest one's bytes, and those of all odometry, whose motion is
    judged.
    """
    if topic == "odometry":
        heard.append(new._replace(payload=new.payload[:ODOMETRY_BYTES]))
        return
    if heard:
        heard[-1] = heard[-1]._replace(payload=b"")
    heard.append(new)


def _estimate(
    estimator: Estimator | None, message: Received, heard: dict[str, list[Heard]]
) -> None:
    """Let GPS and IMU become odometry, as they will when the boat sails."""
    if estimator is None or message.topic not in SENSED:
        return
    with suppress(MessageError):  # its content is judged elsewhere
        if message.topic == "gps":
            estimator.fix(cdr.decode_fix(message.payload))
        else:
            odometry = estimator.imu(cdr.decode_imu(message.payload))
            if odometry is not None:
                payload = cdr.encode_odometry(odometry)
                heard["odometry"].append(Heard(payload, time.monotonic(), None))
    estimator.take_events()


def _heard(message: Received, came_s: float) -> Heard:
    ros_type = TOPICS[message.topic].ros_type
    try:
        stamp_ns = read_stamp(Reader(message.payload, ros_type))
    except MessageError:
        return Heard(message.payload, came_s, None)
    return Heard(message.payload, came_s, time.time() - 1e-9 * stamp_ns)


# -- What the doctor says of what it has heard: rates and ages, stamps, layouts, frames.

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


# -- Does odometry move the way the boat points? Frames that are mixed up are seen nowhere else.

Complex = NDArray[np.complex128]
Values = TypeVar("Values", Float64, Complex)

WHAT = "odometry's motion"
MOVED_M = 0.5
"""[m] A shorter way says nothing about directions."""
TURNED_RAD = np.radians(10.0)
"""[rad] Nor does a smaller turn about the sign of the yaw rate."""
ASTRAY_RAD = np.radians(20.0)
"""[rad] Position and velocity that point this far apart are in different frames."""
FACTOR = 1.5
"""[-] A way this much longer or shorter than the velocities say is in another unit."""
PUSH = "push the boat ahead, then turn it by hand, while the doctor listens"


class Motion(NamedTuple):
    """What a series of odometry says twice: by its positions, and by its velocities."""

    way_m: float
    """[m] Along the positions."""
    told_m: float
    """[m] By the velocities."""
    astray_rad: float
    """[rad] From the direction of the velocities to that of the positions, clockwise."""
    aside_rad: float
    """[rad] From where the boat points to the direction of its positions, clockwise."""
    turn_rad: float
    """[rad] By the headings, in absolute terms along the way."""
    told_turn_rad: float
    """[rad] By the yaw rates, the same, positive where they agree with the headings."""


def motion_of(series: Sequence[Odometry]) -> Motion:
    """Compare positions with velocities, and headings with yaw rates.

    Parameters
    ----------
    series
        Odometry in the order of its stamps, at least two.
    """
    time_s = 1e-9 * np.array([o.stamp_ns - series[0].stamp_ns for o in series])
    heading = np.unwrap([o.heading for o in series])
    position = _complex(np.array([o.position_N[:2] for o in series]))
    turned = [rotation_from_quaternion(o.q_NB) @ o.velocity_B for o in series]
    velocity = _complex(np.array(turned)[:, :2])
    rate = np.array([o.rates_B[2] for o in series])
    dt = np.diff(time_s)
    step, told = np.diff(position), _between(velocity) * dt
    ahead = np.exp(1j * _between(heading))
    turn, told_turn = np.diff(heading), _between(rate) * dt
    return Motion(
        way_m=float(np.abs(step).sum()),
        told_m=float(np.abs(told).sum()),
        astray_rad=float(np.angle((step * told.conj()).sum())),
        aside_rad=float(np.angle((step * ahead.conj()).sum())),
        turn_rad=float(np.abs(turn).sum()),
        told_turn_rad=float((told_turn * np.sign(turn)).sum()),
    )


def judge_motion(payloads: Sequence[bytes]) -> Finding:
    """Judge a series of encoded odometry."""
    try:
        series = [cdr.decode_odometry(payload) for payload in payloads]
    except MessageError as error:
        return fail(WHAT, str(error), "a nav_msgs/Odometry is needed")
    if len(series) < 2:
        return fail(WHAT, "no two messages to compare", "see the lines above")
    motion = motion_of(series)
    found = f"{motion.way_m:.1f} m, {np.degrees(motion.turn_rad):.0f} deg of turning"
    if motion.turn_rad > TURNED_RAD and motion.told_turn_rad < 0:
        return fail(
            WHAT, f"{found}; yaw rates of the other sign", "rates are FLU in ROS: left is positive"
        )
    if motion.way_m < MOVED_M:
        return warn(WHAT, f"{found}: too little to tell", PUSH)
    return _judge_way(motion, found)


def _judge_way(motion: Motion, found: str) -> Finding:
    astray, aside = np.degrees((motion.astray_rad, motion.aside_rad))
    if not motion.told_m * FACTOR > motion.way_m > motion.told_m / FACTOR:
        said = f"{found}, but {motion.told_m:.1f} m by the velocities"
        return fail(WHAT, said, "twist must be in m/s, in the vessel's frame, and filled in")
    if abs(motion.astray_rad) > ASTRAY_RAD:
        said = f"{found}; positions go {astray:.0f} deg clockwise of the velocities"
        return fail(WHAT, said, "the twist must be in the vessel's frame, the pose in ENU")
    if abs(motion.aside_rad) > np.pi / 4:
        said = f"{found}; it moves {aside:.0f} deg clockwise of where it points"
        return warn(WHAT, said, "if it did not drift: the heading is wrong (0 is east in ROS)")
    return ok(WHAT, f"{found}; it moves {aside:.0f} deg clockwise of where it points")


def _complex(pairs: Float64) -> Complex:
    """Give north and east as one complex number: angles then are clockwise from north."""
    north_east: Complex = pairs[:, 0] + 1j * pairs[:, 1]
    return north_east


def _between(values: Values) -> Values:
    return (values[1:] + values[:-1]) / 2


# -- What the doctor says of the autopilot: whether it is heard, and each of its parameters.

WRITE = "twinscrew doctor --listen 10 --write-params, or load config/autopilot/ardurover.parm"
RESTART = "restart the autopilot: some parameters act from then on only"


KEYS = {
    Refusal.UNSIGNED: "give the autopilot our key: twinscrew signing setup; or leave out ours",
    Refusal.OTHER_KEY: "autopilot.signing_key_file is not the autopilot's key: twinscrew signing",
    Refusal.OLD: "set this machine's clock; the autopilot has its time from GPS",
}


def judge_autopilot(link: Autopilot) -> list[Finding]:
    """Say what was heard of the autopilot; of an ArduPilot, of each parameter that matters, too."""
    if isinstance(link, AutopilotLink):
        return _judge_ardupilot(link)
    if not link.status.connected:
        return [fail("autopilot", "nothing is heard", "check the connection string and the cable")]
    return [ok("autopilot", link.status.words)]


def _judge_ardupilot(link: AutopilotLink) -> list[Finding]:
    status = link.status
    if not status.connected and status.refusal is not None:
        return [fail("autopilot", f"its frames are {status.refusal.value}", KEYS[status.refusal])]
    if not status.connected and status.old_frames:
        return [fail("autopilot", "it speaks MAVLink 1", "set SERIALn_PROTOCOL to 2")]
    if not status.connected:
        advice = "check the connection string, the cable, and SERIALn_PROTOCOL 2"
        return [fail("autopilot", "nothing is heard", advice)]
    if status.hears_signed and not link.signs:
        found = "it signs what it sends, and refuses what we send unsigned"
        return [fail("autopilot", found, "give its key: autopilot.signing_key_file")]
    found = f"mode {status.mode}, {'armed' if status.armed else 'disarmed'}"
    parameters = [judge_parameter(state) for state in link.parameters]
    if not status.is_boat:
        return [fail("autopilot", f"{found}, no boat", "set FRAME_CLASS to 2"), *parameters]
    return [ok("autopilot", found), *parameters]


def judge_parameter(state: ParameterState) -> Finding:
    """Say what a parameter is, and what it must be."""
    wanted = f"must be {state.wanted:g}"
    if state.missing:
        advice = "this firmware has no such parameter: is it ArduPilot Rover 4.2 or newer?"
        return fail(state.name, f"missing, {wanted}", advice)
    if state.found is None:
        return warn(state.name, f"not answered yet, {wanted}", "listen longer")
    found = f"{state.found:g}, {wanted}"
    if not state.right:
        return fail(state.name, found, WRITE)
    if state.before is not None:
        return warn(state.name, f"{found}; it was {state.before:g} and has been written", RESTART)
    return ok(state.name, found)

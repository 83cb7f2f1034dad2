"""What comes in from a running boat: rates and ages of topics, and the autopilot's voice."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from msgspec.structs import replace

from twinscrew.runtime.app.checks import Finding, Verdict
from twinscrew.runtime.app.config import RuntimeConfig, autopilot_of, sensor_of
from twinscrew.runtime.app.session import inputs_of
from twinscrew.runtime.bus.inbox import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry.frames import euler_from_quaternion
from twinscrew.runtime.link.authority import AskManual
from twinscrew.runtime.link.autopilot import AutopilotLink
from twinscrew.runtime.link.transport import open_transport
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.perception.stage import Perception

SLOW_SHARE = 0.7
"""[-] A topic slower than this share of its rate is worth a warning."""
FITTING_SHARE = 0.9
"""[-] Fewer points than this share on the described beams: it is another sensor."""


def listen(config: RuntimeConfig, seconds: float) -> list[Finding]:
    """Listen for a while, and say what came; the boat is neither armed nor commanded."""
    inbox = Inbox()
    bus = ZenohBus(config.bus, config.name)
    counts: Counter[str] = Counter()
    newest: dict[str, bytes] = {}
    transport = open_transport(config.autopilot.connection)
    own = config.odometry_source == "autopilot"
    link = AutopilotLink(replace(autopilot_of(config), arm=False, ask_manual=AskManual.NEVER))
    try:
        inbox.listen(bus, inputs_of(config))
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            for message in inbox.wait(0.05):
                counts[message.topic] += 1
                newest[message.topic] = message.payload
            now_s = time.monotonic()
            link.receive(transport.receive(), now_s)
            for odometry in link.take_odometry() if own else ():
                counts["odometry"] += 1
                newest["odometry"] = cdr.encode_odometry(odometry)
            transport.send(link.command(None, now_s) + link.tick(now_s))
    finally:
        bus.close()
        transport.close()
    findings = [_rate(topic, counts[topic] / seconds) for topic in ("points", "odometry")]
    findings += [check(newest, config) for check in (_layout, _sense)]
    return [*findings, _autopilot(link)]


def _rate(topic: str, rate_hz: float) -> Finding:
    expected = TOPICS[topic].rate_hz
    found = f"{rate_hz:.1f} Hz, expected {expected:g} Hz"
    if rate_hz == 0:
        return Finding(topic, Verdict.FAIL, "nothing came", "check the key, namespace and bridge")
    if rate_hz < SLOW_SHARE * expected:
        return Finding(topic, Verdict.WARN, found, "look for a slow link or a busy machine")
    return Finding(topic, Verdict.OK, found)


def _layout(newest: dict[str, bytes], config: RuntimeConfig) -> Finding:
    """Compare a cloud with the sensor's description."""
    what = "cloud and sensor"
    cloud = _decoded(newest, "points", cdr.decode_point_cloud)
    if isinstance(cloud, str):
        return Finding(what, Verdict.FAIL, cloud, "a PointCloud2 with x, y, z is needed")
    perception = Perception(sensor_of(config), config.perception)
    report = perception.project(cloud, np.array([1.0, 0.0, 0.0, 0.0]))
    measured = report.points - report.empty
    fitting = 1.0 - report.no_beam / measured if measured else 1.0
    found = f"{report.points} points, {100 * fitting:.0f} % on the beams of {config.sensor}"
    if fitting < FITTING_SHARE:
        return Finding(what, Verdict.FAIL, found, "choose or write the sensor's description")
    return Finding(what, Verdict.OK, found)


def _sense(newest: dict[str, bytes], config: RuntimeConfig) -> Finding:  # noqa: ARG001
    """Look whether odometry is plausible: upright, and not faster than a boat."""
    what = "odometry's sense"
    odometry = _decoded(newest, "odometry", cdr.decode_odometry)
    if isinstance(odometry, str):
        return Finding(what, Verdict.FAIL, odometry, "a nav_msgs/Odometry is needed")
    roll, pitch, yaw = np.degrees(euler_from_quaternion(odometry.q_NB))
    speed = float(np.hypot(*odometry.velocity_B[:2]))
    found = f"heading {yaw % 360:.0f} deg, roll {roll:.0f}, pitch {pitch:.0f}, {speed:.1f} m/s"
    if max(abs(roll), abs(pitch)) > 45:
        return Finding(what, Verdict.FAIL, found, "the boat lies on its side: frames are mixed up")
    return Finding(what, Verdict.OK, found)


M = TypeVar("M")


def _decoded(newest: dict[str, bytes], topic: str, decode: Callable[[bytes], M]) -> M | str:
    if topic not in newest:
        return "nothing came"
    try:
        return decode(newest[topic])
    except MessageError as error:
        return str(error)


def _autopilot(link: AutopilotLink) -> Finding:
    status = link.status
    if not status.connected:
        advice = "check the connection string, the cable, and SERIALn_PROTOCOL 2"
        return Finding("autopilot", Verdict.FAIL, "nothing is heard", advice)
    found = f"mode {status.mode}, {'armed' if status.armed else 'disarmed'}"
    if not status.is_boat:
        return Finding("autopilot", Verdict.FAIL, f"{found}, no boat", "set FRAME_CLASS to 2")
    if status.parameters_wrong:
        wrong = "; ".join(status.parameters_wrong)
        return Finding(
            "autopilot",
            Verdict.FAIL,
            wrong,
            "load config/autopilot/ardurover.parm, or run with write_parameters",
        )
    return Finding("autopilot", Verdict.OK, found)

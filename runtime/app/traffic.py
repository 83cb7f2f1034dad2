"""What comes in from a running boat: listens to the topics and to the autopilot for a while."""

from __future__ import annotations

import time
from collections import defaultdict
from contextlib import suppress

from msgspec.structs import replace

from twinscrew.runtime.app.finding import Finding
from twinscrew.runtime.app.heard import Heard, judge_content, judge_rate
from twinscrew.runtime.app.heard_autopilot import judge_autopilot
from twinscrew.runtime.bus.base import Inbox, Received
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.estimation.estimator import Estimator
from twinscrew.runtime.link.ardupilot.authority import AskManual
from twinscrew.runtime.link.ardupilot.link import AutopilotLink
from twinscrew.runtime.link.transport import open_transport
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import read_stamp
from twinscrew.runtime.messages.topics import TOPICS
from twinscrew.runtime.messages.wire import Reader
from twinscrew.runtime.vessel.config import SENSED, RuntimeConfig, autopilot_of, inputs_of

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
    link = AutopilotLink(
        replace(
            autopilot_of(config),
            arm=False,
            ask_manual=AskManual.NEVER,
            write_parameters=write_params,
        )
    )
    transport = open_transport(config.autopilot.connection, link.recognises)
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

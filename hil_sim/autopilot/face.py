"""One port of the simulated autopilot: its own framing, its own streams, its own answers."""

from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.commands import execute
from twinscrew.hil_sim.autopilot.fences import FENCE_MESSAGES
from twinscrew.hil_sim.autopilot.rover import Rover
from twinscrew.hil_sim.autopilot.sticks import override_values, stick_values
from twinscrew.hil_sim.autopilot.streams import Streams
from twinscrew.hil_sim.autopilot.telemetry import TELLERS, Moment
from twinscrew.runtime.mavlink import Message, Wire

_NOT_STREAMED = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAVLINK_MSG_ID_ODOMETRY,
)


class Face:
    """What one port says and hears.

    Parameters
    ----------
    rover
        The autopilot, which all ports share.
    wire
        The port's framing.
    intervals_s
        [s] What is sent unasked, by message id.
    """

    def __init__(self, rover: Rover, wire: Wire, intervals_s: dict[int, float]) -> None:
        self.rover = rover
        self.wire = wire
        self.streams = Streams(intervals_s)
        self.replies: list[Message] = []
        self.forwarded: list[bytes] = []
        """Frames of others that go out by this port."""
        self.heard = False
        """Whether anybody ever spoke here."""
        self._once: list[int] = []
        self._fetches = False
        self._now_s = rover.boot_s
        self._handlers: dict[str, Callable[[Message], None]] = {
            "RC_CHANNELS_OVERRIDE": self._on_override,
            "MANUAL_CONTROL": self._on_manual_control,
            "COMMAND_LONG": self._on_command_long,
            "COMMAND_INT": self._on_command_int,
            "SET_MODE": self._on_set_mode,
            "REQUEST_DATA_STREAM": self._on_request_data_stream,
            "TIMESYNC": self._on_timesync,
            "PARAM_REQUEST_LIST": self._on_parameter,
            "PARAM_REQUEST_READ": self._on_parameter,
            "PARAM_SET": self._on_parameter,
            **dict.fromkeys(FENCE_MESSAGES, self._on_mission),
        }

    def take(self, message: Message, now_s: float) -> None:
        """Do what a message asks; most ask for nothing."""
        self._now_s = now_s
        handler = self._handlers.get(message.get_type())
        if handler is not None:
            handler(message)

    def say(self, moment: Callable[[], Moment], now_s: float) -> bytes:
        """Give everything that is to go out: what was handed on, answers, what is due."""
        if self._fetches:  # by the port by which the upload began
            self.replies += self.rover.fences.ask(now_s)
            self._fetches = self.rover.fences.fetches
        due = self._once + self.streams.due(now_s)
        if not due and not self.replies and not self.forwarded:
            return b""
        told = [TELLERS[id_](moment()) for id_ in due] if due else []
        messages = self.replies + [message for message in told if message is not None]
        frames = [*self.forwarded, *(self.wire.encode(message) for message in messages)]
        self.replies, self._once, self.forwarded = [], [], []
        return b"".join(frames)

    def send_once(self, message_id: int) -> None:
        """Send a message with the next step."""
        self._once.append(message_id)

    def _on_override(self, message: Message) -> None:
        self.rover.override(override_values(message), message.get_srcSystem(), self._now_s)

    def _on_manual_control(self, message: Message) -> None:
        values = stick_values(message, self.rover.parameters)
        self.rover.override(values, message.get_srcSystem(), self._now_s)

    def _on_command_long(self, message: Message) -> None:
        params = [getattr(message, f"param{n}") for n in range(1, 8)]
        self._execute(message, params)

    def _on_command_int(self, message: Message) -> None:
        params = [getattr(message, f"param{n}") for n in range(1, 5)]
        self._execute(message, [*params, message.x, message.y, message.z])

    def _execute(self, message: Message, params: list[float]) -> None:
        known = [value if math.isfinite(value) else 0.0 for value in params]
        result = execute(message.command, known, self)
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self.replies.append(
            mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *sender)
        )

    def _on_set_mode(self, message: Message) -> None:
        params = [float(message.base_mode), float(message.custom_mode)]
        execute(mavlink.MAV_CMD_DO_SET_MODE, params, self)

    def _on_parameter(self, message: Message) -> None:
        self.replies.extend(self.rover.parameters.answer(message))

    def _on_mission(self, message: Message) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self.replies += self.rover.fences.take(message, sender, self._now_s)
        self._fetches = self._fetches or self.rover.fences.fetches

    def _on_request_data_stream(self, message: Message) -> None:
        rate_hz = message.req_message_rate if message.start_stop else 0
        for message_id in TELLERS:
            if message_id not in _NOT_STREAMED:
                self.streams.every(message_id, 1.0 / rate_hz if rate_hz else None)

    def _on_timesync(self, message: Message) -> None:
        if message.tc1 == 0:  # a question; anything else is an answer
            boot_ns = round((self._now_s - self.rover.boot_s) * 1e9)
            self.replies.append(mavlink.MAVLink_timesync_message(boot_ns, message.ts1))

"""The simulated autopilot's MAVLink face: bytes in, bytes out, time as an argument."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from msgspec import field
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.commands import execute
from twinscrew.hil_sim.autopilot.rover import Rover, RoverSettings
from twinscrew.hil_sim.autopilot.sticks import override_values, stick_values
from twinscrew.hil_sim.autopilot.streams import Streams
from twinscrew.hil_sim.autopilot.telemetry import TELLERS, Moment, Origin
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.link.paddles import PaddleSettings, thrust_from_pwm
from twinscrew.runtime.link.signing import Signing, read_key
from twinscrew.runtime.link.wire import Message, Wire
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.settings import Positive, Settings


class RoverAutopilotSettings(Settings, frozen=True):
    """The simulated autopilot."""

    rover: RoverSettings = RoverSettings()
    paddles: PaddleSettings = PaddleSettings()
    heartbeat_s: Positive = 1.0
    """[s] Between two heartbeats."""
    streams_hz: dict[str, Positive] = field(default_factory=dict)
    """[Hz] Messages sent from the start, by name, as {"ATTITUDE" = 4}; the rest is on request."""
    signing_key_file: str = ""
    """File of the signing key, readable by its owner only; empty for no signing."""


class RoverAutopilot:
    """One vessel's autopilot on the wire.

    Parameters
    ----------
    settings, system_id, origin
        Its set-up, its MAVLink system id, and where the local frame lies on the earth.
    boot_s
        [s] When it was switched on, in the caller's time.
    signing
        Overrides `signing_key_file`; for tests that bring their own clock.
    """

    def __init__(
        self,
        settings: RoverAutopilotSettings,
        system_id: int,
        origin: Origin | None = None,
        *,
        boot_s: float = 0.0,
        signing: Signing | None = None,
    ) -> None:
        if signing is None and settings.signing_key_file:
            signing = Signing(read_key(Path(settings.signing_key_file)))
        self.rover = Rover(settings.rover, system_id, boot_s)
        wanted = {_message_id(name): 1.0 / hz for name, hz in settings.streams_hz.items()}
        self.streams = Streams({mavlink.MAVLINK_MSG_ID_HEARTBEAT: settings.heartbeat_s} | wanted)
        self.wire = Wire(system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, signing)
        self._paddles = settings.paddles
        self._origin = origin or Origin()
        self._system_id = system_id
        self._once: list[int] = []
        self._replies: list[Message] = []
        self._now_s = boot_s
        self._turned: tuple[int, int] | None = None
        self._thrust: Float64 = np.zeros(2)
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
        }

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes from the network; whatever they are, it never raises."""
        self._now_s = now_s
        for message in self.wire.decode(data):
            handler = self._handlers.get(message.get_type())
            if handler is not None and self._for_us(message):
                handler(message)

    def step(self, now_s: float, vehicle: Odometry | None = None) -> bytes:
        """Let time pass, and give what it sends: answers first, then what is due."""
        self._now_s = now_s
        self.rover.step(now_s)
        for text in self.rover.texts:
            self._replies.append(_statustext(text))
        self.rover.texts.clear()
        due = self._once + self.streams.due(now_s)
        if not due and not self._replies:
            return b""
        moment = Moment(self.rover, vehicle, self._origin, now_s)
        told = [TELLERS[id_](moment) for id_ in due]
        messages = self._replies + [message for message in told if message is not None]
        self._replies, self._once = [], []
        return b"".join(self.wire.encode(message) for message in messages)

    def thrust_command_N(self) -> Float64:
        """Give the thrust, (2,) [N] left and right, that the outputs ask of the propellers."""
        if self.rover.propellers != self._turned:
            self._turned = self.rover.propellers
            self._thrust = np.array([thrust_from_pwm(us, self._paddles) for us in self._turned])
            self._thrust.flags.writeable = False  # the same array is given until it changes
        return self._thrust

    def send_once(self, message_id: int) -> None:
        """Send a message with the next step."""
        self._once.append(message_id)

    def _for_us(self, message: Message) -> bool:
        target = getattr(message, "target_system", getattr(message, "target", 0))
        return target in (0, self._system_id)

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
        self._replies.append(
            mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *sender)
        )

    def _on_set_mode(self, message: Message) -> None:
        params = [float(message.base_mode), float(message.custom_mode)]
        execute(mavlink.MAV_CMD_DO_SET_MODE, params, self)

    def _on_parameter(self, message: Message) -> None:
        self._replies.extend(self.rover.parameters.answer(message))

    def _on_request_data_stream(self, message: Message) -> None:
        rate_hz = message.req_message_rate if message.start_stop else 0
        for message_id in TELLERS:
            if message_id not in _NOT_STREAMED:
                self.streams.every(message_id, 1.0 / rate_hz if rate_hz else None)

    def _on_timesync(self, message: Message) -> None:
        if message.tc1 == 0:  # a question; anything else is an answer
            boot_ns = round((self._now_s - self.rover.boot_s) * 1e9)
            self._replies.append(mavlink.MAVLink_timesync_message(boot_ns, message.ts1))


_NOT_STREAMED = (
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
)


def _message_id(name: str) -> int:
    ids = {teller.__name__.upper(): id_ for id_, teller in TELLERS.items()}
    if name not in ids:
        raise ConfigError(one_of(name, ids), key="streams_hz")
    return ids[name]


def _statustext(text: str) -> Message:
    severity = mavlink.MAV_SEVERITY_CRITICAL if ":" in text else mavlink.MAV_SEVERITY_WARNING
    return mavlink.MAVLink_statustext_message(severity, text.encode("ascii")[:50])

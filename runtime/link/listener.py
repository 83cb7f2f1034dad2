"""What the autopilot said: the part of the link that takes messages in."""

from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link import commands
from twinscrew.runtime.link.authority import FAILSAFE_PARAMETERS, Authority
from twinscrew.runtime.link.conversation import Retried
from twinscrew.runtime.link.modes import MANUAL
from twinscrew.runtime.link.obedience import Obedience
from twinscrew.runtime.link.odometry import OdometryFromAutopilot
from twinscrew.runtime.link.paddles import STOP_US
from twinscrew.runtime.link.parameters import SAFETY, ParameterCheck, expected_parameters
from twinscrew.runtime.link.settings import AutopilotSettings
from twinscrew.runtime.link.streams import Stream
from twinscrew.runtime.link.wire import Message

_TEXTS = 100
"""[-] The most texts kept until somebody asks: a chatty autopilot must not fill the memory."""
_NO_VOLTAGE = 65535
_TEXT_LENGTH = 500
"""[-] Nor an endless one."""
_TELL_UPTIME = frozenset(
    {"ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "SYSTEM_TIME", "RC_CHANNELS"}
)
"""Messages whose `time_boot_ms` says how long the autopilot has been on."""


class Listener:
    """Everything that is known from the autopilot's messages."""

    def __init__(self, settings: AutopilotSettings) -> None:
        target = settings.system_id
        expected = expected_parameters(target)
        if not settings.check_parameters:
            expected = {name: expected[name] for name in SAFETY}
        self.authority = Authority(settings.ask_manual, arm=settings.arm)
        self.parameters = ParameterCheck(
            expected, write=settings.write_parameters, accepted=settings.accept_parameters
        )
        self.streams = [Stream(target, id_, hz) for id_, hz in commands.streams(settings)]
        self.obedience = Obedience(
            settings.obey_tolerance_us, settings.obey_delay_s, settings.obey_patience_s
        )
        self.odometry = OdometryFromAutopilot(settings.datum)
        self.manual = Retried(commands.set_mode(target, MANUAL), every_s=1.0)
        self.arming = Retried(commands.arm(target), every_s=1.0)
        self.texts: list[str] = []
        """What the autopilot told in words and nobody has asked for yet."""
        self._chunked = 0
        self.replies: list[Message] = []
        """What is to be answered."""
        self.vehicle_type: int | None = None
        self.is_boat = False
        self.heartbeat_s = self.message_s = -math.inf
        """[s] When the last one of each came."""
        self.battery: tuple[float | None, int | None] = (None, None)
        """[V, %] What SYS_STATUS said last; None where it does not know."""
        self._settings = settings
        self._handlers: dict[str, Callable[[Message, float], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "SERVO_OUTPUT_RAW": self._on_servo_output,
            "COMMAND_ACK": self._on_ack,
            "STATUSTEXT": self._on_text,
            "PARAM_VALUE": self._on_parameter,
            "SYS_STATUS": self._on_system_status,
            "GPS_GLOBAL_ORIGIN": self.odometry.origin,
            "TIMESYNC": self._on_timesync,
        }
        if settings.state_message == "odometry":
            self._handlers["ODOMETRY"] = self.odometry.whole
        else:
            self._handlers["LOCAL_POSITION_NED"] = self.odometry.position
            self._handlers["ATTITUDE"] = self.odometry.attitude

    def take(self, message: Message, now_s: float) -> bool:
        """Take a message; False if it is not of our autopilot."""
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if sender != (self._settings.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1):
            return False
        if not self.authority.frame(message.get_seq(), now_s):
            if message.get_type() == "HEARTBEAT":
                self.authority.late_heartbeat(message.custom_mode, armed=_is_armed(message))
            return True  # a copy, or overtaken by newer ones: it says what was, not what is
        self.message_s = now_s
        for stream in self.streams:
            stream.arrived(message.get_msgId(), now_s)
        self._note_uptime(message, now_s)
        handler = self._handlers.get(message.get_type())
        if handler is not None:
            handler(message, now_s)
        return True

    def connected(self, now_s: float) -> bool:
        """Tell whether the autopilot is heard."""
        if not now_s - self.heartbeat_s <= self._settings.heartbeat_timeout_s:
            return False  # nor before the first call, when the difference is no number
        longest_s = self._settings.silent_after_s
        streaming = any(stream.shows_silence(longest_s) for stream in self.streams)
        return not streaming or now_s - self.message_s <= longest_s

    def engaged(self, now_s: float) -> bool:
        """Tell whether thrust may act: heard, a boat of ours, with the parameters of safety."""
        ready = self.authority.drives and self.is_boat and self.connected(now_s)
        return ready and not self.parameters.unsafe

    def _note_uptime(self, message: Message, now_s: float) -> None:
        restarted = False
        if message.get_type() == "SERVO_OUTPUT_RAW":
            restarted = self.authority.uptime(message.time_usec, 1e-6, now_s)  # its low 32 bits
        elif message.get_type() in _TELL_UPTIME:
            restarted = self.authority.uptime(message.time_boot_ms, 1e-3, now_s)
        if restarted:
            self.parameters.read_again()
            for stream in self.streams:
                stream.ask_again()

    def _on_heartbeat(self, message: Message, now_s: float) -> None:
        self.heartbeat_s = now_s
        self.vehicle_type = message.type
        self.is_boat = (
            message.type == mavlink.MAV_TYPE_SURFACE_BOAT
            and message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        )
        drove = self.authority.drives
        self.authority.heartbeat(
            message.custom_mode,
            now_s,
            armed=_is_armed(message),
            critical=message.system_status == mavlink.MAV_STATE_CRITICAL,
        )
        if self.authority.drives:
            self.obedience.confirmed(now_s)
        elif drove:
            self.obedience.reset()

    def _on_timesync(self, message: Message, now_s: float) -> None:
        sent_s = self.odometry.clock.answered(message, now_s)
        if sent_s is not None:
            self.authority.reached(sent_s)

    def _on_servo_output(self, message: Message, now_s: float) -> None:
        self.obedience.measured((message.servo1_raw, message.servo3_raw), STOP_US, now_s)

    def _on_system_status(self, message: Message, _now_s: float) -> None:
        volts = message.voltage_battery  # [mV]; 65535: not sent
        left = message.battery_remaining  # [%]; -1: not known
        known = 0 < volts < _NO_VOLTAGE
        self.battery = (volts / 1000 if known else None, left if 0 <= left <= 100 else None)

    def _on_ack(self, message: Message, _now_s: float) -> None:
        us = (self._settings.system_id, self._settings.component_id)
        if message.target_component and (message.target_system, message.target_component) != us:
            return
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.arming.answered(message.result)
            if message.result == mavlink.MAV_RESULT_ACCEPTED and self.authority.asks_arming:
                self.authority.note_armed(True)
            elif message.result != mavlink.MAV_RESULT_IN_PROGRESS:
                self.authority.arming_refused()
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            self.manual.answered(message.result)

    def _on_text(self, message: Message, _now_s: float) -> None:
        text = message.text
        if message.chunk_seq and message.id == self._chunked and self.texts:
            text = self.texts.pop() + text  # a long text comes in chunks of 50 bytes
        self._chunked = message.id
        self.texts = [*self.texts, text[:_TEXT_LENGTH]][-_TEXTS:]
        if text.startswith(("Arm:", "PreArm:")):
            self.arming.reason = text

    def _on_parameter(self, message: Message, _now_s: float) -> None:
        name, value = message.param_id, message.param_value
        self.replies += self.parameters.heard(name, value, self._settings.system_id)
        self.authority.failsafe_holds = self.parameters.has(*FAILSAFE_PARAMETERS)


def _is_armed(heartbeat: Message) -> bool:
    return bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

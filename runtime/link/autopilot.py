"""The companion's side of the MAVLink connection to an ArduPilot boat.

Bytes in, bytes out, time as an argument: the same code runs on a socket, in lock-step and in a
replay. The loop that owns it calls `receive` with what came, `tick` to keep the conversation going
(its heartbeat must come from the working loop: a dead loop falls silent), `command` at 20 Hz.
docs/mavlink.md tells what is sent when, and what a pilot can do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link import commands
from twinscrew.runtime.link.authority import AskManual, Authority
from twinscrew.runtime.link.conditions import Conditions, conditions
from twinscrew.runtime.link.conversation import Retried, Wanted
from twinscrew.runtime.link.events import AUTOPILOT_SAYS
from twinscrew.runtime.link.modes import MANUAL, mode_name
from twinscrew.runtime.link.obedience import Obedience
from twinscrew.runtime.link.odometry import OdometryFromAutopilot
from twinscrew.runtime.link.paddles import STOP_US, PaddleSettings, pwm_from_thrust
from twinscrew.runtime.link.parameters import ParameterCheck, expected_parameters
from twinscrew.runtime.link.signing import Signing, read_key
from twinscrew.runtime.link.status import AutopilotStatus
from twinscrew.runtime.link.wire import Message, Wire
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry, Severity
from twinscrew.runtime.settings import NonNegative, Positive, Settings

SystemId = Annotated[int, Meta(ge=1, le=255)]
_STOP = (STOP_US, STOP_US)
_NO_THRUST = (0.0, 0.0)


class AutopilotSettings(Settings, frozen=True):
    """The link to the autopilot."""

    connection: str = "udpin:127.0.0.1:14550"
    """udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD."""
    system_id: SystemId = 1
    """[-] The vehicle's MAVLink system id, which we share; SYSID_MYGCS must be the same."""
    component_id: SystemId = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
    """[-] 191: onboard computer."""
    arm: bool = False
    """Ask the autopilot to arm, once. Without it somebody else arms the boat."""
    ask_manual: AskManual = AskManual.AFTER_FAILSAFE
    """When to ask for MANUAL mode: never, at_start, after_failsafe (which includes at_start)."""
    receiver_fitted: bool = True
    """A pilot's radio receiver is fitted: let go of the channels when he takes the boat."""
    control: Literal["rc_override", "manual_control"] = "rc_override"
    """The message that carries thrust."""
    paddles: PaddleSettings = PaddleSettings()
    check_parameters: bool = True
    """Read the parameters that the link depends on, and say which are wrong."""
    write_parameters: bool = False
    """Write the wrong ones."""
    servo_output_hz: Positive = 10.0
    """[Hz] How often to hear what drives the propellers."""
    state_hz: NonNegative = 0.0
    """[Hz] How often to hear position and attitude; 0 if odometry comes from elsewhere."""
    silent_after_s: Positive = 0.5
    """[s] Nothing for this long: the autopilot is silent (once its streams run)."""
    heartbeat_timeout_s: Positive = 3.5
    """[s] No heartbeat for this long: the autopilot is silent."""
    obey_tolerance_us: Annotated[int, Meta(ge=1)] = 5
    """[us] How far outputs may differ from commands (measured: 1 us)."""
    obey_delay_s: Positive = 0.5
    """[s] How old a command the outputs may still show."""
    obey_patience_s: Positive = 0.5
    """[s] How long outputs may differ before the link says so."""
    signing_key_file: str = ""
    """File of the signing key, readable by its owner only; empty for no signing."""


class AutopilotLink:
    """One autopilot, as the runtime sees it.

    Parameters
    ----------
    settings
        Who, how, and what we may do without being asked.
    signing
        Overrides `signing_key_file`; for tests that bring their own clock.

    Raises
    ------
    ConfigError
        The signing key cannot be used.
    """

    def __init__(self, settings: AutopilotSettings, *, signing: Signing | None = None) -> None:
        if signing is None and settings.signing_key_file:
            signing = Signing(read_key(Path(settings.signing_key_file)))
        self.settings = settings
        self.wire = Wire(settings.system_id, settings.component_id, signing)
        self.authority = Authority(settings.ask_manual, arm=settings.arm)
        self.odometry_source = OdometryFromAutopilot()
        target = settings.system_id
        expected = expected_parameters(target) if settings.check_parameters else {}
        self.parameters = ParameterCheck(expected, write=settings.write_parameters)
        self._obedience = Obedience(
            settings.obey_tolerance_us, settings.obey_delay_s, settings.obey_patience_s
        )
        self._conditions = Conditions()
        self._manual = Retried(commands.set_mode(target, MANUAL), every_s=1.0)
        self._arming = Retried(commands.arm(target), every_s=1.0)
        self._streams = [
            Wanted(target, message_id, rate_hz)
            for message_id, rate_hz in commands.streams(settings.servo_output_hz, settings.state_hz)
        ]
        self._outbox: list[Message] = []
        self._said: list[str] = []
        self._vehicle_type: int | None = None
        self._is_boat = False
        self._heartbeat_s = self._message_s = self._servo_s = -math.inf
        self._now_s = -math.inf
        self._beat_s = -math.inf
        self._commanded_s = -math.inf
        self._first_command_s: float | None = None
        self._let_go_s: float | None = None
        self._handlers: dict[str, Callable[[Message, float], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "SERVO_OUTPUT_RAW": self._on_servo_output,
            "COMMAND_ACK": self._on_ack,
            "STATUSTEXT": self._on_text,
            "PARAM_VALUE": self._on_parameter,
            "LOCAL_POSITION_NED": self.odometry_source.position,
            "ATTITUDE": self.odometry_source.attitude,
        }

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes from the autopilot; whatever they are, it never raises."""
        self._now_s = now_s
        for message in self.wire.decode(data):
            if (
                message.get_srcSystem() != self.settings.system_id
                or message.get_srcComponent() != mavlink.MAV_COMP_ID_AUTOPILOT1
            ):
                continue
            self._message_s = now_s
            for stream in self._streams:
                stream.heard(message.get_msgId(), now_s)
            handler = self._handlers.get(message.get_type())
            if handler is not None:
                handler(message, now_s)

    def tick(self, now_s: float) -> bytes:
        """Give what keeps the conversation going: heartbeat, requests, texts.

        If no command came lately, neutral commands are among it: a boat whose policy thinks too
        long stops.
        """
        self._now_s = now_s
        messages = self._outbox
        self._outbox = []
        if now_s - self._beat_s >= commands.HEARTBEAT_S:
            self._beat_s = now_s
            messages.append(commands.heartbeat())
        if self._heard(now_s):
            messages += self._requests(now_s)
        late = now_s - self._commanded_s > commands.COMMAND_STALE_S
        neutral = self.command(_NO_THRUST, now_s) if late else b""
        return b"".join(self.wire.encode(message) for message in messages) + neutral

    def command(self, thrust: Float64 | Sequence[float] | None, now_s: float) -> bytes:
        """Give the bytes that ask for thrust.

        Parameters
        ----------
        thrust : (2,) float64, or None
            [N] Left, right. None: we want nothing; with a receiver fitted, an armed boat is then
            the pilot's to steer.
        now_s
            [s] The caller's time.

        Returns
        -------
        bytes
            Stop unless the autopilot is armed, in MANUAL and heard; nothing while a pilot with a
            receiver steers.
        """
        self._now_s = self._commanded_s = now_s
        if self._first_command_s is None:
            self._first_command_s = now_s
        if self._lets_go(nothing_wanted=thrust is None):
            return self._let_go(now_s)
        self._let_go_s = None
        pair = _STOP
        if thrust is not None and self._engaged(now_s):
            scale = self.settings.paddles
            pair = (
                pwm_from_thrust(float(thrust[0]), scale),
                pwm_from_thrust(float(thrust[1]), scale),
            )
        if self.authority.drives:
            self._obedience.commanded(pair, now_s)
        return self._override(pair)

    def events(self, now_s: float) -> tuple[HealthEvent, ...]:
        """Give what began, ended or was said since the last call."""
        self._now_s = now_s
        stamp_ns = round(now_s * 1e9)
        holding = conditions(self.status, self.authority, self._manual, self._arming)
        said = [AUTOPILOT_SAYS.at(stamp_ns, text) for text in self._said]
        self._said = []
        return (*said, *self._conditions.changes(holding, stamp_ns))

    def say(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Send a text to the ground station (STATUSTEXT) with the next tick."""
        self._outbox += commands.statustext(text, severity)

    def ask_again(self) -> None:
        """Ask for MANUAL and arming as at the start: an operator's explicit word."""
        self.authority.ask_again()

    def disarm(self) -> None:
        """Ask the autopilot to disarm with the next tick."""
        self._outbox.append(commands.disarm(self.settings.system_id))

    @property
    def odometry(self) -> Odometry | None:
        """The newest odometry made of the autopilot's messages; None if there is none."""
        return self.odometry_source.newest

    @property
    def status(self) -> AutopilotStatus:
        """What is known, as of the last call."""
        return AutopilotStatus(
            connected=self._heard(self._now_s),
            armed=self.authority.armed,
            mode=mode_name(self.authority.mode),
            vehicle_type=self._vehicle_type,
            is_boat=self._is_boat,
            pilot_has_it=self.authority.taken,
            failsafe_hold=self.authority.held,
            obeying=self._obedience.obeying,
            outputs_us=self._obedience.outputs,
            message_age_s=self._now_s - self._message_s,
            heartbeat_age_s=self._now_s - self._heartbeat_s,
            bad_frames=self.wire.bad_frames,
            parameters_wrong=self.parameters.wrong,
        )

    def _engaged(self, now_s: float) -> bool:
        return self.authority.drives and self._is_boat and self._heard(now_s)

    def _heard(self, now_s: float) -> bool:
        if now_s - self._heartbeat_s > self.settings.heartbeat_timeout_s:
            return False
        streaming = self._servo_s > -math.inf
        return not streaming or now_s - self._message_s <= self.settings.silent_after_s

    def _requests(self, now_s: float) -> list[Message]:
        messages = [m for stream in self._streams for m in stream.ask(now_s)]
        messages += self.parameters.ask(self.settings.system_id, now_s)
        if not self._is_boat:
            return messages
        if self.authority.asks_manual:
            messages += self._manual.ask(now_s)
        started_s = math.inf if self._first_command_s is None else self._first_command_s
        if self.authority.asks_arming and now_s - started_s >= commands.STREAM_BEFORE_ARMING_S:
            messages += self._arming.ask(now_s)
        return messages

    def _override(self, pair: tuple[int, int]) -> bytes:
        released = pair == commands.RELEASED
        control = "rc_override" if released else self.settings.control
        return self.wire.encode(commands.thrust(self.settings.system_id, pair, control))

    def _lets_go(self, *, nothing_wanted: bool) -> bool:
        """Tell whether the pilot's receiver has the channels."""
        if not self.settings.receiver_fitted:
            return False
        return self.authority.taken or (nothing_wanted and self.authority.drives)

    def _let_go(self, now_s: float) -> bytes:
        """Stop, then give the channels back, then be silent."""
        if self._let_go_s is None:
            self._let_go_s = now_s
            self._obedience.reset()
        since_s = now_s - self._let_go_s
        if since_s > commands.STOP_BEFORE_RELEASE_S + commands.RELEASE_S:
            return b""
        stopping = since_s < commands.STOP_BEFORE_RELEASE_S
        return self._override(_STOP if stopping else commands.RELEASED)

    def _on_heartbeat(self, message: Message, now_s: float) -> None:
        self._heartbeat_s = now_s
        self._vehicle_type = message.type
        self._is_boat = (
            message.type == mavlink.MAV_TYPE_SURFACE_BOAT
            and message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        )
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        drove = self.authority.drives
        self.authority.heard(message.custom_mode, armed, now_s)
        if drove and not self.authority.drives:
            self._obedience.reset()

    def _on_servo_output(self, message: Message, now_s: float) -> None:
        self._servo_s = now_s
        outputs = (message.servo1_raw, message.servo3_raw)
        self._obedience.measured(outputs, STOP_US, now_s)

    def _on_ack(self, message: Message, _now_s: float) -> None:
        us = (self.settings.system_id, self.settings.component_id)
        if message.target_component and (message.target_system, message.target_component) != us:
            return
        accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
        if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self._arming.answered(message.result)
            if accepted and self.authority.asks_arming:
                self.authority.note_armed(True)
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
            self._manual.answered(message.result)

    def _on_text(self, message: Message, now_s: float) -> None:
        self._said.append(message.text)
        if message.text.startswith("Radio Failsafe"):
            self.authority.failsafe(now_s)
        if message.text.startswith(("Arm:", "PreArm:")):
            self._arming.reason = message.text

    def _on_parameter(self, message: Message, _now_s: float) -> None:
        target = self.settings.system_id
        self._outbox += self.parameters.heard(message.param_id, message.param_value, target)

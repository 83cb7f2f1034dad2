"""What the autopilot sends, and whether its outputs follow the commands."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Hashable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.ardupilot import commands
from twinscrew.runtime.link.ardupilot.ais import ais_sentences
from twinscrew.runtime.link.ardupilot.authority import (
    FAILSAFE_PARAMETERS,
    INITIALISING,
    MANUAL,
    Authority,
)
from twinscrew.runtime.link.ardupilot.commands import Retried, Stream
from twinscrew.runtime.link.ardupilot.odometry import OdometryFromAutopilot
from twinscrew.runtime.link.ardupilot.parameters import SAFETY, ParameterCheck, expected_parameters
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.link.ardupilot.thrust import STOP_US, Outputs
from twinscrew.runtime.mavlink import Message

# -- Does the autopilot do what it is told? Only SERVO_OUTPUT_RAW knows.
#
# ArduPilot ignores overrides of a system it does not listen to (SYSID_MYGCS) without a word, and
# RC_CHANNELS may show values long past. So the outputs are compared with what was commanded within
# the last moments: the link has a delay, and the thrust may be on its way. And when a pilot takes
# the boat the outputs stop at once, but the heartbeat that says so comes up to a second later: it
# is waited for.


TRIES = 3
"""[-] After the autopilot disobeyed this often, it is not tried again until something changes."""
WITHHELD_S = 5.0
"""[s] Neutral thrust for this long between two tries."""
TRUSTED_S = 5.0
"""[s] Obeyed for this long without a break: earlier disobedience is forgotten."""

Pair = tuple[int, int]
"""Left and right [us]."""


class Obedience:
    """Compares outputs with commands.

    Parameters
    ----------
    tolerance_us
        [us] Difference that rounding may make (measured: 1 us).
    delay_s
        [s] How old a command the outputs may still show.
    patience_s
        [s] How long outputs may differ before that is disobedience.
    """

    def __init__(self, tolerance_us: int, delay_s: float, patience_s: float) -> None:
        self._tolerance_us = tolerance_us
        self._delay_s = delay_s
        self._patience_s = patience_s
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when somebody else drove."""
        self._commands: deque[tuple[float, Pair]] = deque()
        self._differs_since_s: float | None = None
        self._confirmed_s = -math.inf
        self.obeying: bool | None = None
        """True if the outputs follow, False if not, None while that is unproven: the outputs
        never left stop, so that nobody can tell."""
        self.outputs: Pair | None = None
        """[us] The last outputs."""

    def commanded(self, pair: Pair, now_s: float) -> None:
        """Note a command that was sent."""
        self._commands.append((now_s, pair))
        while len(self._commands) > 1 and self._commands[1][0] < now_s - self._delay_s:
            self._commands.popleft()  # one older than the delay stays: it acted when it began

    def confirmed(self, now_s: float) -> None:
        """Note that the autopilot says we drive: outputs that differ are nobody else's doing."""
        self._confirmed_s = now_s

    def measured(self, outputs: Pair, stop: int, now_s: float) -> None:
        """Judge the outputs that SERVO_OUTPUT_RAW tells; `stop` [us] proves nothing."""
        self.outputs = outputs
        if not self._commands or now_s - self._commands[0][0] < self._delay_s / 2:
            return
        if self._explained(outputs):
            self._differs_since_s = None
            if any(abs(o - stop) > self._tolerance_us for o in outputs):
                self.obeying = True
            elif self.obeying is False:
                self.obeying = None
            return
        if self._differs_since_s is None:
            self._differs_since_s = now_s
        since_s = self._differs_since_s
        if now_s - since_s >= self._patience_s and self._confirmed_s > since_s:
            self.obeying = False

    def _explained(self, outputs: Pair) -> bool:
        for side, output in enumerate(outputs):
            sent = [pair[side] for _, pair in self._commands]
            low, high = min(sent) - self._tolerance_us, max(sent) + self._tolerance_us
            if not low <= output <= high:
                return False
        return True


class Trials:
    """Decides whether an autopilot that disobeyed is tried again: a few times, then not."""

    def __init__(self) -> None:
        self._situation: Hashable = None
        self._disobeyed = 0
        self._withheld_until_s = -math.inf
        self._obeys_since_s: float | None = None

    @property
    def given_up(self) -> bool:
        """Whether nothing but a change of the situation brings a further try."""
        return self._disobeyed >= TRIES

    def judge(self, obeying: bool | None, situation: Hashable, now_s: float) -> None:
        """Take what `Obedience` says; a situation that differs from the last one starts over."""
        if situation != self._situation:
            self._situation, self._disobeyed = situation, 0
            self._withheld_until_s = -math.inf
        if obeying is False and not self.withhold(now_s):
            self._disobeyed += 1
            self._withheld_until_s = now_s + WITHHELD_S
        if obeying is not True:
            self._obeys_since_s = None
        elif self._obeys_since_s is None:
            self._obeys_since_s = now_s
        elif now_s - self._obeys_since_s >= TRUSTED_S:
            self._disobeyed = 0

    def withhold(self, now_s: float) -> bool:
        """Tell whether thrust is to be neutral now."""
        return self.given_up or now_s < self._withheld_until_s


# -- What the autopilot said: the part of the link that takes messages in.

_REPORTS = 300
"""[-] The most AIS sentences kept until somebody asks."""
_TEXTS = 100
"""[-] The most texts kept until somebody asks: a chatty autopilot must not fill the memory."""
_NO_VOLTAGE = 65535
DEPTH_KEPT_S = 3.0
"""[s] An echo sounder that has said nothing for longer is not believed: it sends once a second."""
_TEXT_LENGTH = 500
"""[-] Nor an endless one."""
_INITIALISING = frozenset(
    {mavlink.MAV_STATE_UNINIT, mavlink.MAV_STATE_BOOT, mavlink.MAV_STATE_CALIBRATING}
)
"""What a heartbeat says of an autopilot that takes no mode yet, whichever mode it is in."""
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
        self.outputs: Outputs | None = None
        """What the autopilot makes of the two channels; None: it hands them through."""
        self.new_outputs: Pair | None = None
        """[us] Left and right of SERVO_OUTPUT_RAW, until somebody takes them."""
        self._chunked = 0
        self.replies: list[Message] = []
        """What is to be answered."""
        self.vehicle_type: int | None = None
        self.is_boat = False
        self.heartbeat_s = self.message_s = -math.inf
        """[s] When the last one of each came."""
        self.battery: tuple[float | None, int | None] = (None, None)
        """[V, %] What SYS_STATUS said last; None where it does not know."""
        self.vessels: list[tuple[float, str]] = []
        """Age [s] and sentence of each AIS report that was forwarded and nobody has taken yet."""
        self._depth: tuple[float, float] = (math.nan, -math.inf)
        self._settings = settings
        self._handlers: dict[str, Callable[[Message, float], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "SERVO_OUTPUT_RAW": self._on_servo_output,
            "COMMAND_ACK": self._on_ack,
            "STATUSTEXT": self._on_text,
            "PARAM_VALUE": self._on_parameter,
            "SYS_STATUS": self._on_system_status,
            "WATER_DEPTH": self._on_water_depth,
            "GPS_GLOBAL_ORIGIN": self.odometry.origin,
            "TIMESYNC": self._on_timesync,
            "AIS_VESSEL": self._on_ais_vessel,
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
        initialising = message.system_status in _INITIALISING
        self.authority.heartbeat(
            INITIALISING if initialising else message.custom_mode,
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
        self.new_outputs = (message.servo1_raw, message.servo3_raw)
        stop_us = STOP_US if self.outputs is None else self.outputs.pulses((STOP_US, STOP_US))[0]
        self.obedience.measured(self.new_outputs, stop_us, now_s)

    def _on_system_status(self, message: Message, _now_s: float) -> None:
        volts = message.voltage_battery  # [mV]; 65535: not sent
        left = message.battery_remaining  # [%]; -1: not known
        known = 0 < volts < _NO_VOLTAGE
        self.battery = (volts / 1000 if known else None, left if 0 <= left <= 100 else None)

    def _on_ais_vessel(self, message: Message, _now_s: float) -> None:
        self.vessels = [*self.vessels, *ais_sentences(message)][-_REPORTS:]

    def depth_m(self, now_s: float) -> float | None:
        """[m] Give the water's depth, if the echo sounder is well and said so lately."""
        depth_m, came_s = self._depth
        return depth_m if now_s - came_s <= DEPTH_KEPT_S else None

    def _on_water_depth(self, message: Message, now_s: float) -> None:
        if message.healthy and math.isfinite(message.distance) and message.distance >= 0.0:
            self._depth = (float(message.distance), now_s)

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

    def _on_text(self, message: Message, now_s: float) -> None:
        text = message.text
        if message.chunk_seq and message.id == self._chunked and self.texts:
            text = self.texts.pop() + text  # a long text comes in chunks of 50 bytes
        self._chunked = message.id
        self.texts = [*self.texts, text[:_TEXT_LENGTH]][-_TEXTS:]
        if text.startswith(("Arm:", "PreArm:")):
            self.arming.explained(text, now_s)

    def _on_parameter(self, message: Message, _now_s: float) -> None:
        name, value = message.param_id, message.param_value
        self.replies += self.parameters.heard(name, value, self._settings.system_id)
        if name.startswith(("SERVO", "MOT_")):
            self.outputs = Outputs.bent(self.parameters.values)
        self.authority.failsafe_holds = self.parameters.has(*FAILSAFE_PARAMETERS)


def _is_armed(heartbeat: Message) -> bool:
    return bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

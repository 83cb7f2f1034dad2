"""The companion's side of the MAVLink connection to an ArduPilot boat.

Bytes in, bytes out, time as an argument: the same code runs on a socket, in lock-step and in a
replay. docs/mavlink.md says what is sent when, and what a pilot can do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.charts.static_map import Feature
from twinscrew.runtime.ground.orders import OrderSettings
from twinscrew.runtime.ground.stations import Stations
from twinscrew.runtime.link.ardupilot import commands
from twinscrew.runtime.link.ardupilot.authority import mode_name
from twinscrew.runtime.link.ardupilot.fences import FenceReader
from twinscrew.runtime.link.ardupilot.listener import Listener, Trials
from twinscrew.runtime.link.ardupilot.parameters import GCS_ID, OTHER_NAMES, ParameterState
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.link.ardupilot.thrust import (
    RELEASED,
    STOP,
    ChannelRelease,
    Pair,
    Thrust,
    paddles,
)
from twinscrew.runtime.link.transport import Transport, await_transport, reopening
from twinscrew.runtime.mavlink import Message, Refusal, Signing, Wire, read_key
from twinscrew.runtime.messages.types import HealthEvent, Odometry, Severity
from twinscrew.runtime.safety.events import (
    ARMING_REFUSED,
    AUTOPILOT_DISARMED,
    AUTOPILOT_RECOVERED,
    AUTOPILOT_SAYS,
    AUTOPILOT_SILENT,
    FAILSAFE_HOLD,
    GREATEST_DETAIL,
    MESSAGE_UNSENT,
    MODE_REFUSED,
    MODE_TAKEN,
    OVERRIDE_IGNORED,
    PARAMETERS_UNSAFE,
    PARAMETERS_WRITTEN,
    PARAMETERS_WRONG,
    STREAM_SLOW,
    WRONG_VEHICLE,
    EventKind,
)

# -- What the link knows of the autopilot, as one frozen record.


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotStatus:
    """The autopilot as the link sees it now."""

    connected: bool
    """Whether it is heard."""
    armed: bool
    mode: str
    """Name of its mode, as "MANUAL"; "unknown" before the first heartbeat."""
    vehicle_type: int | None
    """MAV_TYPE of its heartbeat; 11 is a surface boat."""
    is_boat: bool
    """Whether it is an ArduPilot surface boat."""
    pilot_has_it: bool
    """Whether a pilot chose another mode than MANUAL."""
    failsafe_hold: bool
    """Whether its radio failsafe holds the boat."""
    obeying: bool | None
    """Whether its outputs follow our commands; None while nobody can tell (all at stop)."""
    outputs_us: tuple[int, int] | None
    """[us] Left, right: what drives the propellers, as SERVO_OUTPUT_RAW says."""
    message_age_s: float
    """[s] Since the last message of any kind; infinite if there was none."""
    heartbeat_age_s: float
    """[s] Since the last heartbeat."""
    bad_frames: int
    """[-] Frames refused so far: damaged, or not signed as they should be."""
    old_frames: int
    """[-] Frames of MAVLink 1 that came; ArduPilot sends them until it hears MAVLink 2."""
    refusal: Refusal | None
    """Why most of the refused frames of the autopilot were refused, if they were whole."""
    hears_signed: bool
    """Whether it signs what it sends."""
    parameters_wrong: tuple[str, ...]
    """Words about each parameter that is not what it must be."""
    parameters_unsafe: tuple[str, ...]
    """Words about each parameter that forbids driving: wrong, missing, or not read yet."""
    engaged: bool
    """Whether thrust commands act: heard, a boat of ours, armed, in MANUAL mode, with the right
    parameters, and not disobeying."""
    battery_v: float | None = None
    """[V] As the autopilot measures it; None if it has not said."""
    station_age_s: float = math.inf
    """[s] Since a ground station's last heartbeat; infinite if there was none."""
    depth_m: float | None = None
    """[m] Of the water under the autopilot's echo sounder; None if it does not say."""
    battery_percent: int | None = None
    """[%] What is left of it; None if the autopilot does not know."""

    @property
    def words(self) -> str:
        """Mode, arming and battery, as "MANUAL, armed, 12.6 V 87 %"."""
        if not self.connected:
            return "silent"
        parts = [self.mode, "armed" if self.armed else "disarmed"]
        if self.battery_v is not None:
            left = "" if self.battery_percent is None else f" {self.battery_percent} %"
            parts.append(f"{self.battery_v:.1f} V{left}")
        return ", ".join(parts)


# -- From what the link knows to health events: each condition once when it begins, once when over.

Holding = dict[EventKind, str]
"""The conditions that hold now, each with its detail in plain words."""


TOLD_AGAIN = frozenset(
    {MODE_TAKEN, PARAMETERS_WRONG, PARAMETERS_UNSAFE, OVERRIDE_IGNORED, ARMING_REFUSED}
)
"""Conditions whose words matter: an event follows whenever they change."""


def conditions(status: AutopilotStatus, listener: Listener, now_s: float) -> Holding:
    """Give every condition that an operator should know."""
    if not status.connected:
        return {AUTOPILOT_SILENT: _silence(status)}
    if not status.is_boat:
        return {WRONG_VEHICLE: f"MAV_TYPE {status.vehicle_type}, must be 11 (FRAME_CLASS 2)"}
    authority, manual, arming = listener.authority, listener.manual, listener.arming
    holding: Holding = {}
    if status.pilot_has_it:
        holding[MODE_TAKEN] = _taken(status)
    if status.failsafe_hold:
        holding[FAILSAFE_HOLD] = "overrides had stopped"
    if authority.was_armed and not status.armed:
        holding[AUTOPILOT_DISARMED] = f"mode {status.mode}"
    if authority.asks_manual and manual.refusal is not None:
        holding[MODE_REFUSED] = f"result {manual.refusal} in mode {status.mode}"
    if authority.asks_arming and arming.refusal is not None:
        holding[ARMING_REFUSED] = arming.reason or f"result {arming.refusal}"
    if authority.arming_unknown and not authority.was_armed:
        holding[ARMING_REFUSED] = "no answer came, and messages were lost: arm it by hand"
    slow = [words for stream in listener.streams if (words := stream.refused(now_s)) is not None]
    if slow:
        holding[STREAM_SLOW] = "; ".join(slow)
    parameters = listener.parameters
    if parameters.done and parameters.wrong:
        holding[PARAMETERS_WRONG] = "; ".join(parameters.wrong)
    if parameters.done and parameters.unsafe:
        holding[PARAMETERS_UNSAFE] = "; ".join(parameters.unsafe)
    return holding


def why_ignored(listener: Listener, *, given_up: bool) -> str:
    """Say why the outputs do not follow, as far as the parameters show it."""
    parameters = listener.parameters
    ours = [words for words in parameters.wrong if words.startswith((GCS_ID, OTHER_NAMES[GCS_ID]))]
    causes = [*ours, *parameters.shaping]
    if causes:
        words = "; ".join(causes)
    elif parameters.has(GCS_ID):
        words = "the parameters that were read are right: is RCx_OPTION 46 or the safety switch on?"
    else:
        words = f"{GCS_ID} may be another system's id"
    return f"{words}; not tried again until something changes" if given_up else words


def _taken(status: AutopilotStatus) -> str:
    if status.mode != "MANUAL":
        return f"mode {status.mode}"
    return "mode MANUAL, but by a restart or a late request: choose another mode, then MANUAL"


class Conditions:
    """Remembers what held, and gives the changes."""

    def __init__(self) -> None:
        self._held: Holding = {}

    def changes(self, holding: Holding, stamp_ns: int) -> list[HealthEvent]:
        """Give an event for each condition that began, or is over."""
        begun = [
            kind.at(stamp_ns, part)
            for kind, words in holding.items()
            if kind not in self._held or (kind in TOLD_AGAIN and words != self._held[kind])
            for part in _parts(words)
        ]
        over = [
            AUTOPILOT_RECOVERED.at(stamp_ns, kind.name)
            for kind in self._held
            if kind not in holding
        ]
        self._held = holding
        return begun + over


def _parts(words: str) -> list[str]:
    """Divide a long list, so that no event's detail is cut."""
    parts = [""]
    for item in words.split("; "):
        if parts[-1] and len(parts[-1]) + len(item) + 2 > GREATEST_DETAIL:
            parts.append("")
        parts[-1] += f"; {item}" if parts[-1] else item
    return parts


def _silence(status: AutopilotStatus) -> str:
    if math.isfinite(status.message_age_s):
        return f"last message {status.message_age_s:.1f} s ago"
    if status.old_frames:
        return "it speaks MAVLink 1: set SERIALx_PROTOCOL to 2"
    if status.refusal is not None:
        return f"its frames are refused: {status.refusal.value}"
    if status.bad_frames:
        return f"{status.bad_frames} frames refused: damaged"
    return "nothing heard yet"


__all__ = ["AutopilotLink", "AutopilotSettings", "AutopilotStatus"]


class AutopilotLink:
    """One autopilot, as the runtime sees it.

    Parameters
    ----------
    settings
        Who, how, and what we may do without being asked.
    signing
        Overrides `signing_key_file`; for tests that bring their own clock.
    stations
        Takes what ground stations say to us; None: nobody listens to them.

    Raises
    ------
    ConfigError
        The signing key cannot be used.
    """

    def __init__(
        self,
        settings: AutopilotSettings,
        *,
        signing: Signing | None = None,
        stations: Stations | None = None,
    ) -> None:
        if signing is None and settings.signing_key_file:
            signing = Signing(read_key(Path(settings.signing_key_file)))
        self.settings = settings
        self.wire = Wire(settings.system_id, settings.component_id, signing)
        self.stations = stations
        self._listener = Listener(settings)
        self._conditions = Conditions()
        self._release = ChannelRelease()
        self._trials = Trials()
        self._fences = FenceReader(settings)
        self._words = 0
        self._outbox: list[Message] = []
        self._texts = 0
        self._unsent: list[str] = []
        self._now_s = self._beat_s = self._commanded_s = self._station_s = -math.inf
        self._first_command_s = math.inf

    def open(self, stop: Callable[[], bool]) -> Transport:
        """Open the connection, and keep it open: it is opened again when it breaks."""
        connection, known = self.settings.connection, self.wire.recognises
        opened = await_transport(connection, self.settings.wait_s, stop, known)
        return reopening(connection, opened, known)

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes from the autopilot; whatever they are, it never raises."""
        self._now_s = now_s
        for message in self.wire.decode(data):
            if self._listener.take(message, now_s):
                self._fences.take(message, now_s)
                continue
            if message.get_type() == "HEARTBEAT" and message.type == mavlink.MAV_TYPE_GCS:
                self._station_s = now_s
            if self.stations is not None:
                self.stations.take(message, now_s)
        self._judge_obedience(now_s)

    @property
    def topics(self) -> tuple[str, ...]:
        """See `Autopilot`; it speaks MAVLink alone."""
        return ()

    def hear(self, topic: str, payload: bytes, now_s: float) -> None:
        """See `Autopilot`."""

    def tick(self, now_s: float, *, may_ask: bool = True) -> bytes:
        """Give what keeps the conversation going: heartbeat, requests, texts.

        If no command came lately, stop is commanded with it: a boat whose policy thinks too long
        stops. A message that cannot be written is left out, and named by an event.

        Parameters
        ----------
        now_s
            [s] The caller's time.
        may_ask
            Whether MANUAL and arming may be asked for; not by a caller who could not drive.
        """
        self._now_s = now_s
        messages = self._outbox + self._listener.replies
        self._outbox, self._listener.replies = [], []
        if now_s - self._beat_s >= commands.HEARTBEAT_S:
            self._beat_s = now_s
            messages.append(commands.heartbeat())
        if self._listener.connected(now_s):
            messages += self._requests(now_s, may_ask=may_ask)
        if self.stations is not None:
            messages += self.stations.due(now_s)
        if self._commanded_s == -math.inf:
            self._commanded_s = now_s
        late = now_s - self._commanded_s > commands.COMMAND_STALE_S
        stop = self.command((0.0, 0.0), now_s) if late else b""
        return b"".join(self._frame(message) for message in messages) + stop

    def command(self, thrust: Thrust | None, now_s: float) -> bytes:
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
            Stop unless the autopilot is heard, ours, armed and in MANUAL, has the parameters on
            which safety rests, and obeys; nothing while a pilot with a receiver steers.
        """
        self._now_s = self._commanded_s = now_s
        self._first_command_s = min(self._first_command_s, now_s)
        if self._is_the_pilots(nothing_wanted=thrust is None):
            self._listener.obedience.reset()
            pair = self._release.let_go(now_s)
            return b"" if pair is None else self._override(pair)
        self._release.hold()
        acts = thrust is not None and self._engaged(now_s)
        pair = paddles(thrust, self.settings.paddles) if acts and thrust is not None else STOP
        expected, outputs = pair, self._listener.outputs
        if outputs is not None:
            pair = outputs.channels(pair) if acts else STOP
            expected = outputs.pulses(pair)
        if self._listener.authority.drives:
            self._listener.obedience.commanded(expected, now_s)
        return self._override(pair)

    def take_outputs(self) -> Pair | None:
        """Give what drives the propellers [us], left and right, if it was told since last asked."""
        outputs, self._listener.new_outputs = self._listener.new_outputs, None
        return outputs

    def events(self, now_s: float) -> tuple[HealthEvent, ...]:
        """Give what began, ended or was said since the last call."""
        self._now_s = now_s
        stamp_ns = round(now_s * 1e9)
        listener = self._listener
        said = [AUTOPILOT_SAYS.at(stamp_ns, text) for text in listener.texts]
        listener.texts = []
        said += [MESSAGE_UNSENT.at(stamp_ns, why) for why in self._unsent]
        self._unsent = []
        written = listener.parameters.take_written()
        if written:
            said.append(PARAMETERS_WRITTEN.at(stamp_ns, "; ".join(written)))
        holding = conditions(self.status, listener, now_s)
        if self._trials.withhold(now_s):
            holding[OVERRIDE_IGNORED] = why_ignored(listener, given_up=self._trials.given_up)
        return (*said, *self._conditions.changes(holding, stamp_ns))

    def say(self, text: str, severity: Severity = Severity.INFO) -> None:
        """Send a text to the ground station (STATUSTEXT) with the next tick."""
        self._texts += 1
        self._outbox += commands.statustext(text, severity, self._texts)

    def tell(self, messages: Iterable[Message]) -> None:
        """Send messages with the next tick; the autopilot hands them on to ground stations."""
        self._outbox += messages

    def ask_again(self) -> None:
        """Ask for MANUAL and arming as at the start: an operator's explicit word."""
        self._words += 1
        self._listener.authority.ask_again()

    def disarm(self) -> None:
        """Ask the autopilot to disarm with the next tick."""
        self._outbox.append(commands.disarm(self.settings.system_id))

    @property
    def signs(self) -> bool:
        """Whether we sign what we send, and refuse what is not signed."""
        return self.wire.signs

    @property
    def odometry(self) -> Odometry | None:
        """The newest odometry made of the autopilot's messages; None if there is none."""
        return self._listener.odometry.newest

    def take_odometry(self) -> list[Odometry]:
        """Give every odometry made of the autopilot's messages since the last call."""
        return self._listener.odometry.take()

    def take_fences(self) -> tuple[Feature, ...] | str | None:
        """See `Autopilot`."""
        return self._fences.news()

    def take_ais(self) -> list[tuple[float, str]]:
        """Give what the autopilot has forwarded of AIS: age [s] and sentence of each report."""
        heard, self._listener.vessels = self._listener.vessels, []
        return heard

    @property
    def parameters_checked(self) -> bool:
        """Whether every parameter that the link depends on was answered or given up."""
        return self._listener.parameters.done

    @property
    def parameters(self) -> tuple[ParameterState, ...]:
        """What is known of each parameter that the link depends on."""
        return self._listener.parameters.states

    @property
    def status(self) -> AutopilotStatus:
        """What is known, as of the last call."""
        listener, authority = self._listener, self._listener.authority
        refused = self.wire.refused
        return AutopilotStatus(
            connected=listener.connected(self._now_s),
            armed=authority.armed,
            mode=mode_name(authority.mode),
            vehicle_type=listener.vehicle_type,
            is_boat=listener.is_boat,
            pilot_has_it=authority.taken,
            failsafe_hold=authority.held,
            obeying=listener.obedience.obeying,
            outputs_us=listener.obedience.outputs,
            message_age_s=self._now_s - listener.message_s,
            heartbeat_age_s=self._now_s - listener.heartbeat_s,
            bad_frames=self.wire.bad_frames,
            old_frames=self.wire.old_frames,
            refusal=max(refused, key=refused.__getitem__) if refused else None,
            hears_signed=self.wire.hears_signed,
            parameters_wrong=listener.parameters.wrong,
            battery_v=listener.battery[0],
            battery_percent=listener.battery[1],
            parameters_unsafe=listener.parameters.unsafe,
            engaged=self._engaged(self._now_s),
            station_age_s=self._now_s - self._station_s,
            depth_m=listener.depth_m(self._now_s),
        )

    def _requests(self, now_s: float, *, may_ask: bool) -> list[Message]:
        listener, authority = self._listener, self._listener.authority
        messages = [request for stream in listener.streams for request in stream.ask(now_s)]
        messages += listener.parameters.ask(self.settings.system_id, now_s)
        messages += listener.odometry.clock.ask(now_s)
        messages += self._fences.ask(now_s)
        if not may_ask:
            return messages
        if listener.is_boat and authority.asks_manual and (ask := listener.manual.ask(now_s)):
            authority.manual_asked(now_s)
            messages += ask
        streaming = now_s - self._first_command_s >= commands.STREAM_BEFORE_ARMING_S
        ready = listener.is_boat and streaming and not listener.parameters.unsafe
        if ready and authority.asks_arming and (ask := listener.arming.ask(now_s)):
            authority.arming_asked()
            messages += ask
        return messages

    def _frame(self, message: Message) -> bytes:
        """Give a message's frame; none if a field cannot hold what it should say."""
        try:
            return self.wire.encode(message)
        except Exception as error:  # pymavlink raises whatever struct and its own code do
            self._unsent.append(f"{message.get_type()}: {error}")
            return b""

    def _engaged(self, now_s: float) -> bool:
        return self._listener.engaged(now_s) and not self._trials.withhold(now_s)

    def _judge_obedience(self, now_s: float) -> None:
        listener, authority = self._listener, self._listener.authority
        parameters = listener.parameters.wrong
        situation = (authority.mode, authority.armed, parameters, self._words)
        withheld = self._trials.withhold(now_s)
        self._trials.judge(listener.obedience.obeying, situation, now_s)
        if self._trials.withhold(now_s) and not withheld:
            listener.parameters.read_again()  # one of them may be why

    def _is_the_pilots(self, *, nothing_wanted: bool) -> bool:
        authority = self._listener.authority
        if not self.settings.receiver_fitted:
            return False
        return authority.taken or (nothing_wanted and authority.drives)

    def _override(self, pair: Pair) -> bytes:
        control = "rc_override" if pair == RELEASED else self.settings.control
        return self.wire.encode(commands.thrust(self.settings.system_id, pair, control))


def make(settings: AutopilotSettings, orders: OrderSettings | None) -> AutopilotLink:
    """Make an ArduPilot's link, by way of which ground stations give orders (`AUTOPILOTS`)."""
    us = (settings.system_id, settings.component_id)
    stations = None if orders is None else Stations(orders, settings.datum, us)
    return AutopilotLink(settings, stations=stations)

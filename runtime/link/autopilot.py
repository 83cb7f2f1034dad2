"""The companion's side of the MAVLink connection to an ArduPilot boat.

Bytes in, bytes out, time as an argument: the same code runs on a socket, in lock-step and in a
replay. The loop that owns it calls `receive` with what came, `tick` to keep the conversation going
(its heartbeat must come from the working loop: a dead loop falls silent), `command` at 20 Hz.
docs/mavlink.md tells what is sent when, and what a pilot can do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from twinscrew.runtime.link import commands
from twinscrew.runtime.link.conditions import Conditions, conditions, why_ignored
from twinscrew.runtime.link.events import (
    AUTOPILOT_SAYS,
    MESSAGE_UNSENT,
    OVERRIDE_IGNORED,
    PARAMETERS_WRITTEN,
)
from twinscrew.runtime.link.listener import Listener
from twinscrew.runtime.link.modes import mode_name
from twinscrew.runtime.link.obedience import Trials
from twinscrew.runtime.link.paddling import RELEASED, STOP, LettingGo, Pair, Thrust, paddles
from twinscrew.runtime.link.parameters import ParameterState
from twinscrew.runtime.link.settings import AutopilotSettings
from twinscrew.runtime.link.signing import Signing, read_key
from twinscrew.runtime.link.stations import Stations
from twinscrew.runtime.link.status import AutopilotStatus
from twinscrew.runtime.link.wire import Message, Wire
from twinscrew.runtime.messages.types import HealthEvent, Odometry, Severity

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
        self._letting_go = LettingGo()
        self._trials = Trials()
        self._words = 0
        self._outbox: list[Message] = []
        self._texts = 0
        self._unsent: list[str] = []
        self._now_s = self._beat_s = self._commanded_s = -math.inf
        self._first_command_s = math.inf

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes from the autopilot; whatever they are, it never raises."""
        self._now_s = now_s
        for message in self.wire.decode(data):
            if not self._listener.take(message, now_s) and self.stations is not None:
                self.stations.take(message, now_s)
        self._judge_obedience(now_s)

    def recognises(self, datagram: bytes) -> bool:
        """Tell whether a datagram is our autopilot's: see `Wire.recognises`."""
        return self.wire.recognises(datagram)

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
            pair = self._letting_go.let_go(now_s)
            return b"" if pair is None else self._override(pair)
        self._letting_go.hold()
        acts = thrust is not None and self._engaged(now_s)
        pair = paddles(thrust, self.settings.paddles) if acts and thrust is not None else STOP
        if self._listener.authority.drives:
            self._listener.obedience.commanded(pair, now_s)
        return self._override(pair)

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
    def odometry(self) -> Odometry | None:
        """The newest odometry made of the autopilot's messages; None if there is none."""
        return self._listener.odometry.newest

    def take_odometry(self) -> list[Odometry]:
        """Give every odometry made of the autopilot's messages since the last call."""
        return self._listener.odometry.take()

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
            parameters_wrong=listener.parameters.wrong,
            battery_v=listener.battery[0],
            battery_percent=listener.battery[1],
            parameters_unsafe=listener.parameters.unsafe,
            engaged=self._engaged(self._now_s),
        )

    def _requests(self, now_s: float, *, may_ask: bool) -> list[Message]:
        listener, authority = self._listener, self._listener.authority
        messages = [request for stream in listener.streams for request in stream.ask(now_s)]
        messages += listener.parameters.ask(self.settings.system_id, now_s)
        messages += listener.odometry.clock.ask(now_s)
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

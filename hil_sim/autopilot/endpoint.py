"""The simulated autopilot's MAVLink face: bytes in, bytes out, time as an argument."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from msgspec import field
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.face import Face
from twinscrew.hil_sim.autopilot.routing import AUTOPILOT, Routes
from twinscrew.hil_sim.autopilot.rover import Rover, RoverSettings
from twinscrew.hil_sim.autopilot.streams import Streams
from twinscrew.hil_sim.autopilot.telemetry import (
    DEFAULT_INTERVAL_S,
    STREAMED,
    TELLERS,
    Moment,
    Origin,
)
from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings, thrust_from_pwm
from twinscrew.runtime.mavlink import Message, Signing, Wire, read_key
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.settings import Positive, Settings


class RoverAutopilotSettings(Settings, frozen=True):
    """The simulated autopilot."""

    rover: RoverSettings = RoverSettings()
    paddles: PaddleSettings = PaddleSettings()
    heartbeat_s: Positive = 1.0
    """[s] Between two heartbeats."""
    streams_hz: dict[str, Positive] = field(default_factory=dict)
    """[Hz] How often messages are sent from the start, by name, as {"ATTITUDE" = 4}. Those of
    ArduRover's streams come once a second unless it says otherwise, the rest on request."""
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
    ports
        [-] How many ports it has. A companion is on port 0; the autopilot hands messages on.
    """

    def __init__(
        self,
        settings: RoverAutopilotSettings,
        system_id: int,
        origin: Origin | None = None,
        *,
        boot_s: float = 0.0,
        signing: Signing | None = None,
        ports: int = 1,
    ) -> None:
        if signing is None and settings.signing_key_file:
            signing = Signing(read_key(Path(settings.signing_key_file)))
        self.rover = Rover(settings.rover, system_id, boot_s)
        chosen = {_message_id(name): 1.0 / hz for name, hz in settings.streams_hz.items()}
        streams = dict.fromkeys(STREAMED, DEFAULT_INTERVAL_S)
        wanted = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: settings.heartbeat_s} | streams | chosen
        self._faces = [
            Face(self.rover, Wire(system_id, AUTOPILOT, signing), wanted) for _ in range(ports)
        ]
        self._us = (system_id, AUTOPILOT)
        self._routes = Routes(self._us, ports)
        self._paddles = settings.paddles
        self._origin = origin or Origin()
        self._vehicle: Odometry | None = None
        self._mode = self.rover.mode
        self._now_s = boot_s
        self._turned: tuple[int, int] | None = None
        self._thrust: Float64 = np.zeros(2)

    @property
    def wire(self) -> Wire:
        """Port 0's framing."""
        return self._faces[0].wire

    @property
    def streams(self) -> Streams:
        """What port 0 is sent, and how often."""
        return self._faces[0].streams

    def receive(self, data: bytes, now_s: float, port: int = 0) -> None:
        """Take bytes from the network; whatever they are, it never raises."""
        self._now_s = now_s
        for message in self._faces[port].wire.decode(data):
            self._faces[port].heard = True
            locally, others = self._routes.route(message, port)
            for other in others:
                self._faces[other].forwarded.append(bytes(message.get_msgbuf()))
            if locally and message.get_type() == "SETUP_SIGNING":
                self._set_up_signing(message)
                break  # what came with it was of the time before
            if locally:
                self._take(message, port)

    def step(self, now_s: float, vehicle: Odometry | None = None) -> bytes:
        """Let time pass, and give what port 0 sends: answers first, then what is due."""
        self._now_s, self._vehicle = now_s, vehicle
        if vehicle is not None:
            self.rover.surge_mps = float(vehicle.velocity_B[0])
        self.rover.step(now_s)
        if self.rover.mode is not self._mode:  # everybody is told of a new mode at once
            self._mode = self.rover.mode
            for face in self._faces:
                face.streams.at_once(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        for text in self.rover.texts:
            for face in self._faces:
                face.replies.append(_statustext(text))
        self.rover.texts.clear()
        return self.outgoing(0)

    def outgoing(self, port: int) -> bytes:
        """Give what a port sends, as of the last step."""
        return self._faces[port].say(self._moment, self._now_s)

    def thrust_command_N(self) -> Float64:
        """Give the thrust, (2,) [N] left and right, that the outputs ask of the propellers."""
        if self.rover.propellers != self._turned:
            self._turned = self.rover.propellers
            self._thrust = np.array([thrust_from_pwm(us, self._paddles) for us in self._turned])
            self._thrust.flags.writeable = False  # the same array is given until it changes
        return self._thrust

    def _take(self, message: Message, port: int) -> None:
        face = self._faces[port]
        before = len(face.replies)
        face.take(message, self._now_s)
        if message.get_type() == "PARAM_SET":  # everybody is told of a change
            for other in self._faces:
                if other is not face and other.heard:
                    other.replies += face.replies[before:]

    def _set_up_signing(self, message: Message) -> None:
        """Take a signing key: from now on every port signs, and refuses what is not signed.

        Read: GCS_Signing.cpp. An armed autopilot takes none; a key and a time that are all zero end
        signing. A real one goes on accepting unsigned frames on its first port (USB).
        """
        if message.target_system not in (0, self._us[0]):
            return
        if self.rover.armed:
            self.rover.texts.append("ERROR: Won't setup signing when armed")
            return
        key = bytes(message.secret_key)
        for port, face in enumerate(self._faces):
            signing = Signing(key, link_id=port) if any(key) or message.initial_timestamp else None
            face.wire = Wire(*self._us, signing)

    def _moment(self) -> Moment:
        return Moment(self.rover, self._vehicle, self._origin, self._now_s)


def _message_id(name: str) -> int:
    ids = {teller.__name__.upper(): id_ for id_, teller in TELLERS.items()}
    if name not in ids:
        raise ConfigError(one_of(name, ids), key="streams_hz")
    return ids[name]


def _statustext(text: str) -> Message:
    severity = mavlink.MAV_SEVERITY_CRITICAL if ":" in text else mavlink.MAV_SEVERITY_WARNING
    return mavlink.MAVLink_statustext_message(severity, text.encode("ascii")[:50])

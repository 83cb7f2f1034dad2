"""Real time: a process for each vessel's runtime, joined by Zenoh and by MAVLink."""

from __future__ import annotations

import contextlib
import signal
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import msgspec
import numpy as np
from msgspec.structs import replace

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.udp import AutopilotOnTheNet
from twinscrew.hil_sim.children import undisturbed
from twinscrew.hil_sim.drivers.processes import (
    LOOPBACK,
    START_LIMIT_S,
    RuntimeProcess,
    free_port,
    see_off,
)
from twinscrew.runtime.bus.base import Received, Receiver
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.errors import LinkError, MessageError
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings
from twinscrew.runtime.link.transport import UdpTransport, open_transport
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry, Severity
from twinscrew.runtime.safety.events import (
    AUTOPILOT_NOW,
    AUTOPILOT_RECOVERED,
    INPUT_RECOVERED,
    OF_THE_AUTOPILOT,
)
from twinscrew.runtime.senses.nmea import NmeaSettings
from twinscrew.runtime.senses.table import sense_topics
from twinscrew.runtime.vessel.config import RuntimeConfig, inputs_of
from twinscrew.runtime.vessel.trial import TRIAL_ENDS


class Fleet(Protocol):
    """One autopilot a vessel, all on their own feet: they speak MAVLink with the runtimes."""

    patience_s: float
    """[s] How much longer than usual the runtimes may wait for them at the start."""

    def connection(self, vessel: int) -> str:
        """Give the connection string of a vessel's autopilot, for its runtime."""

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """Let an autopilot take in what came and send what is due."""

    def thrust_N(self) -> Float64:
        """Give what the autopilots ask of the propellers, (V, 2) [N]."""

    def wait(self, until_s: float) -> None:
        """Pass the time until the clock, `time.monotonic`, says `until_s` [s]."""

    def check(self) -> None:
        """Raise a `LinkError` if an autopilot has died."""

    def close(self) -> None:
        """Stop them all."""


class Autopilot(Protocol):
    """What asks something of the propellers."""

    def thrust_command_N(self) -> Float64:
        """Give the thrust, (2,) [N] left and right, that the outputs ask of the propellers."""


class OnTheNet(Protocol):
    """An autopilot with its connection, as `AutopilotOnTheNet`."""

    @property
    def autopilot(self) -> Autopilot:
        """Whose connection it is."""

    def step(self, now_s: float, vehicle: Odometry | None) -> None:
        """Take what came, let time pass, send what is due; never waits."""

    def close(self) -> None:
        """Close the connection."""


class SimulatedFleet:
    """Our simulated autopilots, each on a UDP port of its own."""

    patience_s = 0.0

    def __init__(self, pilots: Sequence[OnTheNet], ports: Sequence[int]) -> None:
        """Take autopilots, and the ports on which they listen."""
        self._pilots = pilots
        self._ports = ports

    def connection(self, vessel: int) -> str:
        """See `Fleet`."""
        return f"udpout:{LOOPBACK}:{self._ports[vessel]}"

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Fleet`."""
        self._pilots[vessel].step(now_s, odometry)

    def thrust_N(self) -> Float64:
        """See `Fleet`."""
        return np.array([pilot.autopilot.thrust_command_N() for pilot in self._pilots])

    def wait(self, until_s: float) -> None:
        """See `Fleet`."""
        time.sleep(max(0.0, until_s - time.monotonic()))

    def check(self) -> None:
        """Nothing can have died but this process."""

    def close(self) -> None:
        """See `Fleet`."""
        for pilot in self._pilots:
            pilot.close()


def simulated_fleet(
    system_ids: Sequence[int],
    settings: RoverAutopilotSettings | None = None,
    ground: str = "",
    paddles: Sequence[PaddleSettings] = (),
) -> SimulatedFleet:
    """Make autopilots of these system ids in this process.

    Parameters
    ----------
    ground
        HOST:PORT where a ground station listens. They call it on a second port, and hand messages
        on between it and the companions. Empty: there is none.
    paddles
        What each one's outputs mean; none: what the settings say, for all.

    Raises
    ------
    LinkError
        There is no such place to call.
    """
    settings = settings or RoverAutopilotSettings()
    each = [replace(settings, paddles=scale) for scale in paddles] or [settings] * len(system_ids)
    lines = [[open_transport(f"udpout:{ground}")] if ground else [] for _ in system_ids]
    transports = [UdpTransport(LOOPBACK, 0, listens=True) for _ in system_ids]
    pilots = [
        AutopilotOnTheNet(RoverAutopilot(one, system_id, ports=1 + len(line)), transport, *line)
        for system_id, one, transport, line in zip(system_ids, each, transports, lines, strict=True)
    ]
    return SimulatedFleet(pilots, [transport.port for transport in transports])


class Troubles:
    """What ails a vessel now, from the health events that its runtime publishes."""

    OVER = frozenset({AUTOPILOT_RECOVERED.name, INPUT_RECOVERED.name})
    """Events whose detail names what is over: a condition, or an input that was stale."""
    REMEMBERED = 500
    """[-] The last so many words are told once."""

    def __init__(self) -> None:
        self._autopilot = ""
        self._held: dict[str, str] = {}
        self._told: deque[tuple[str, str]] = deque(maxlen=self.REMEMBERED)

    def note(self, event: HealthEvent) -> bool:
        """Take an event; False if the same was said before, with the same words."""
        if event.name == AUTOPILOT_NOW.name:
            self._autopilot = event.detail
        elif event.name in self.OVER:
            self._held = {
                name: words
                for name, words in self._held.items()
                if name != event.detail and not words.startswith(f"{event.detail}: ")
            }
        elif event.severity is not Severity.INFO:
            self._held[event.name] = event.detail
        said = (event.name, event.detail)
        is_new = said not in self._told
        if is_new:
            self._told.append(said)
        return is_new

    @property
    def words(self) -> str:
        """The autopilot's state, and each trouble that is not over."""
        troubles = [f"{name}: {words}" if words else name for name, words in self._held.items()]
        return "; ".join(part for part in (self._autopilot, *troubles) if part)


# -- Real time: a process for each vessel's runtime, joined by Zenoh and by MAVLink.

SETTLE_S = 0.5
"""[s] A vessel is ready this long after its runtime could drive first."""


class RealtimeCrew:
    """All vessels' runtimes as processes; a context."""

    exchange_s = 0.01

    def __init__(
        self,
        configs: list[RuntimeConfig],
        folders: list[Path],
        fleet: Fleet | None = None,
        tell: Callable[[str], None] | None = None,
        reroute: Callable[[int, int], int] | None = None,
        zenoh: ZenohSettings | None = None,
    ) -> None:
        """Prepare the crew.

        Parameters
        ----------
        configs
            The runtimes' configurations; their connections are filled in here.
        folders
            Where each vessel's configuration and log are written.
        fleet
            The vessels' autopilots, closed with the crew; ours if none are given.
        tell
            Takes what the autopilots say and what ails them, in Zenoh's thread.
        reroute
            Gives the port to which a vessel's runtime connects, of its index and the simulator's
            port: somebody may stand between them.
        zenoh
            The simulator's Zenoh, which listens at one port of this machine; any by default.
        """
        self._configs = configs
        self._folders = folders
        self._fleet = fleet or simulated_fleet(
            [c.autopilot.system_id for c in configs],
            paddles=[c.autopilot.paddles for c in configs],
        )
        self._tell = tell
        self._reroute = reroute or (lambda _vessel, port: port)
        self._zenoh = zenoh or ZenohSettings(
            listen=(f"tcp/{LOOPBACK}:{free_port()}",), connect=(), node="simulator"
        )
        self._buses: list[ZenohBus] = []
        self._runtimes: list[RuntimeProcess] = []
        self._engaged = [False] * len(configs)
        self._trials = [""] * len(configs)
        self._troubles = [Troubles() for _ in configs]
        self._ready_since: dict[int, float] = {}
        self._now_s = 0.0
        self._begin_s: float | None = None
        self._nmea: dict[int, UdpTransport] = {}
        self.endpoint = ""
        """Where the simulator's Zenoh listens, once it does."""
        self.late_s = 0.0
        """[s] The most that simulated time fell behind the clock."""

    def __enter__(self) -> Self:
        (self.endpoint,) = self._zenoh.listen
        port = int(self.endpoint.rpartition(":")[2])
        names = [config.name for config in self._configs]
        try:
            bus = ZenohBus(self._zenoh, names[0])
            self._buses = [bus.within(name) for name in names]
            for vessel in range(len(self._configs)):
                self._listen_to(vessel)
                config = self._complete(vessel, self._reroute(vessel, port))
                with undisturbed():
                    self._runtimes.append(RuntimeProcess(config, self._folders[vessel]))
            self._wait_for_runtimes()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:  # noqa: ARG002
        """See `Crew`; odometry that the runtime makes itself is its own to publish.

        Sentences of NMEA go as a receiver sends them: as lines, in datagrams.
        """
        if topic == "nmea" and vessel in self._nmea:
            with contextlib.suppress(MessageError):  # of a line that a fault has damaged
                text = cdr.decode_sentence(payload).text
                self._nmea[vessel].send(f"{text}\r\n".encode(errors="replace"))
        elif topic in inputs_of(self._configs[vessel]):
            self._buses[vessel].publish(topic, payload)

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Crew`."""
        self._now_s = now_s
        self._fleet.exchange(vessel, now_s, odometry)
        if self._engaged[vessel]:  # once: on a busy machine a late scan disengages it for a moment
            self._ready_since.setdefault(vessel, now_s)

    def is_ready(self, vessel: int) -> bool:
        """See `Crew`."""
        since_s = self._ready_since.get(vessel)
        return since_s is not None and self._now_s - since_s >= SETTLE_S

    def trial_outcome(self, vessel: int) -> str:
        """See `Crew`; a boat that was stopped early may still brake."""
        return self._trials[vessel]

    def why_not_ready(self, vessel: int) -> str:
        """See `Crew`."""
        return self._troubles[vessel].words

    def thrust_N(self) -> Float64:
        """See `Crew`."""
        return self._fleet.thrust_N()

    def retire(self, vessel: int) -> None:
        """Let the runtime run on: its inputs have stopped, and it must cope with that."""

    def keep_pace(self, now_s: float) -> None:
        """See `Crew`."""
        clock_s = time.monotonic()
        if self._begin_s is None:
            self._begin_s = clock_s - now_s
        due_s = self._begin_s + now_s
        self.late_s = max(self.late_s, clock_s - due_s)
        self._fleet.wait(due_s)

    def check(self) -> None:
        """See `Crew`."""
        self._fleet.check()
        for runtime in self._runtimes:
            runtime.check()

    def kill(self, vessel: int) -> None:
        """Kill a vessel's runtime as hard as can be; that is no error until it is started again."""
        self._runtimes[vessel].kill()

    def start_again(self, vessel: int) -> None:
        """Start a runtime that was killed."""
        with undisturbed():
            self._runtimes[vessel].start_again()

    def signal(self, vessel: int, number: signal.Signals) -> None:
        """Send a vessel's runtime a signal."""
        self._runtimes[vessel].signal(number)

    def listen(self, vessel: int, topic: str, receive: Receiver) -> None:
        """Have everything called that a vessel's runtime says on a topic, in Zenoh's thread."""
        self._buses[vessel].subscribe(topic, receive)

    @property
    def down(self) -> frozenset[int]:
        """Vessels whose runtimes were killed and not started again."""
        return frozenset(i for i, runtime in enumerate(self._runtimes) if runtime.down)

    @property
    def pids(self) -> tuple[int, ...]:
        """The runtimes' process ids."""
        return tuple(runtime.pid for runtime in self._runtimes)

    def close(self) -> None:
        """Stop every process, and wait for it."""
        see_off(self._runtimes)
        self._fleet.close()
        for line in self._nmea.values():
            line.close()
        for bus in self._buses[:1]:  # they share one session
            bus.close()

    def _listen_to(self, vessel: int) -> None:
        self._buses[vessel].subscribe("engagement", lambda message: self._note(vessel, message))
        self._buses[vessel].subscribe("diagnostics", lambda told: self._pass_on(vessel, told))

    def _complete(self, vessel: int, port: int) -> RuntimeConfig:
        """Give a runtime's configuration with its connections to autopilot and simulator."""
        config = self._configs[vessel]
        autopilot = msgspec.structs.replace(
            config.autopilot,
            connection=self._fleet.connection(vessel),
            wait_s=self._fleet.patience_s,
        )
        bus = msgspec.structs.replace(config.bus, connect=(f"tcp/{LOOPBACK}:{port}",))
        senses = config.senses
        if "nmea" in sense_topics(senses):
            port = free_port()
            self._nmea[vessel] = UdpTransport(LOOPBACK, port, listens=False)
            receiver = NmeaSettings(connections=(f"udpin:{LOOPBACK}:{port}",))
            senses = msgspec.structs.replace(senses, nmea=receiver)
        return msgspec.structs.replace(config, autopilot=autopilot, bus=bus, senses=senses)

    def _wait_for_runtimes(self) -> None:
        for config, bus in zip(self._configs, self._buses, strict=True):
            limit_s = START_LIMIT_S + self._fleet.patience_s
            deadline_s = time.monotonic() + limit_s
            while not bus.wait_for_subscribers(inputs_of(config), 0.2):
                self.check()
                if time.monotonic() > deadline_s:
                    raise LinkError(
                        f"the runtime of {config.name} does not listen after {limit_s:g} s"
                    )

    def _pass_on(self, vessel: int, message: Received) -> None:
        """Take health events, in Zenoh's thread; those of the autopilot are for the user."""
        with contextlib.suppress(MessageError):
            for event in cdr.decode_diagnostics(message.payload):
                if event.name in TRIAL_ENDS:
                    self._trials[vessel] = event.name
                is_new = self._troubles[vessel].note(event)
                if self._tell is not None and is_new and event.name in OF_THE_AUTOPILOT:
                    self._tell(f"{self._configs[vessel].name}: {event.name}: {event.detail}")

    def _note(self, vessel: int, message: Received) -> None:
        """Take word, in Zenoh's thread, that a runtime drives or does not."""
        with contextlib.suppress(MessageError):
            self._engaged[vessel] = cdr.decode_engagement(message.payload).engaged

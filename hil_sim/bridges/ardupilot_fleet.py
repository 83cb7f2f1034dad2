"""Real ArduPilots in the loop: the simulator's world is their physics."""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from msgspec import field

from twinscrew.hil_sim.bridges.ardupilot_process import HOST, Instance, Process, close_all
from twinscrew.hil_sim.bridges.backend import JsonBackend
from twinscrew.hil_sim.bridges.datagrams import DatagramPort
from twinscrew.hil_sim.bridges.inertial import moment
from twinscrew.hil_sim.children import undisturbed
from twinscrew.hil_sim.world import World
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings, thrust_from_pwm
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.settings import NonNegative, Positive, Settings, convert
from twinscrew.runtime.vessel.hull_settings import paddles

LOOK_S = 0.2
"""[s] Those that the world waits for are looked at this often: they may have died."""
LEFT, RIGHT = 0, 2
"""Outputs 1 and 3: SERVO1_FUNCTION 73, SERVO3_FUNCTION 74."""


class ArduPilotSettings(Settings, frozen=True):
    """Which ArduPilots, and how long to wait for them."""

    binary: str = ""
    """ArduRover's simulator (`ardurover`); empty: somebody else starts one a vessel."""
    ground: str = ""
    """HOST:PORT where a ground station listens (UDP); empty: it may call them (TCP 5762 + 10 N)."""
    memory: str = ""
    """A folder in which each keeps its memory, parameters that were written among it, from run to
    run; empty: each run begins with wiped ones."""
    first_instance: int = 0
    """[-] Instance number of the first vessel's; the others count on."""
    patience_s: NonNegative = 300.0
    """[s] How long the user may take to start them."""
    silent_s: Positive = 15.0
    """[s] One that asks for no frame this long has died: it asks again at least every 10 s."""
    paddles: PaddleSettings = field(default_factory=PaddleSettings)


class ArduPilotFleet:
    """One ArduPilot simulator a vessel; see `Fleet`.

    The world waits for all of them: within a step nobody's time lags behind the others'.
    """

    def __init__(
        self,
        world: World,
        folders: Sequence[Path],
        settings: ArduPilotSettings,
        tell: Callable[[str], None],
    ) -> None:
        """Listen on every physics port, and start the simulators, or say how.

        Parameters
        ----------
        world
            Where the vessels are.
        folders
            Where each vessel's simulator keeps its files.
        tell
            Takes words for the user.

        Raises
        ------
        LinkError
            A port is in use.
        ConfigError
            The binary cannot be started.
        """
        self.patience_s = settings.patience_s
        self._settings = settings
        self._world = world
        self._paddles = [convert(paddles(vessel), PaddleSettings) for vessel in world.vessels]
        kept, names = settings.memory, world.scenario.names
        memories = [Path(kept) / name if kept else None for name in names]
        self._instances = [
            Instance(settings.first_instance + i, i + 1, folder, settings.ground, memory)
            for i, (folder, memory) in enumerate(zip(folders, memories, strict=True))
        ]
        self._backends = [JsonBackend(moment(world.state, i, 0.0)) for i in self._vessels]
        self._asked_s = [time.monotonic()] * len(self._backends)
        self._ports: list[DatagramPort] = []
        self._peers: list[object] = [None] * len(self._backends)
        self._processes: list[Process] = []
        self._poll = select.poll()
        try:
            self._open(tell)
        except BaseException:
            self.close()
            raise

    def connection(self, vessel: int) -> str:
        """See `Fleet`."""
        return self._instances[vessel].connection

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Fleet`: theirs is a line of their own."""

    def thrust_N(self) -> Float64:
        """See `Fleet`; nothing before an ArduPilot is heard."""
        return np.array(
            [
                self._thrust_N(backend, scale)
                for backend, scale in zip(self._backends, self._paddles, strict=True)
            ]
        )

    def wait(self, until_s: float) -> None:
        """Give every ArduPilot its frames up to the world's present, and the clock its time."""
        now_s = self._world.time_s
        for i, backend in enumerate(self._backends):
            backend.move(moment(self._world.state, i, now_s))
            self._answer(i)
        while True:
            left_s = until_s - time.monotonic()
            if left_s <= 0.0 and all(backend.caught_up for backend in self._backends):
                return
            self._serve(left_s if left_s > 0.0 else LOOK_S)

    def check(self) -> None:
        """See `Fleet`."""
        for process in self._processes:
            process.check()

    def close(self) -> None:
        """See `Fleet`."""
        close_all(self._processes)
        for port in self._ports:
            port.close()

    @property
    def _vessels(self) -> range:
        return range(self._world.scenario.vessels)

    def _open(self, tell: Callable[[str], None]) -> None:
        binary = self._settings.binary
        for instance in self._instances:
            port = DatagramPort(HOST, instance.physics_port)
            self._ports.append(port)
            self._poll.register(port.fileno(), select.POLLIN)
            instance.write_parameters()
        if binary:
            for instance in self._instances:
                with undisturbed():
                    self._processes.append(Process(instance, Path(binary)))
            return
        tell("Start one ArduPilot a vessel, each in a shell of its own:")
        for instance in self._instances:
            tell(f"  {instance.command_line('ardurover')}")

    def _serve(self, timeout_s: float) -> None:
        """Wait for frames once, and answer those that can be."""
        descriptors = {descriptor for descriptor, _ in self._poll.poll(1e3 * timeout_s)}
        if not descriptors:
            self._look_for_the_silent()
        for i, port in enumerate(self._ports):
            if port.fileno() in descriptors:
                self._take(i)
                self._answer(i)

    def _take(self, vessel: int) -> None:
        while (received := self._ports[vessel].receive()) is not None:
            datagram, sender = received
            if self._backends[vessel].receive(datagram):
                self._peers[vessel] = sender
                self._asked_s[vessel] = time.monotonic()

    def _answer(self, vessel: int) -> None:
        answer = self._backends[vessel].answer()
        if answer:
            self._ports[vessel].send(answer, self._peers[vessel])

    def _look_for_the_silent(self) -> None:
        self.check()
        limit_s = time.monotonic() - self._settings.silent_s
        for backend, instance, asked_s in zip(
            self._backends, self._instances, self._asked_s, strict=True
        ):
            if not backend.caught_up and asked_s < limit_s:
                raise LinkError(
                    f"ArduPilot's instance {instance.number} asks for no physics any more "
                    f"(UDP port {instance.physics_port})"
                )

    def _thrust_N(self, backend: JsonBackend, scale: PaddleSettings) -> tuple[float, float]:
        if not backend.heard:
            return 0.0, 0.0
        pwm_us = backend.pwm_us
        return thrust_from_pwm(pwm_us[LEFT], scale), thrust_from_pwm(pwm_us[RIGHT], scale)

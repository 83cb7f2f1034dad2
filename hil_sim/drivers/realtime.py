"""Real time: a process for each vessel's runtime, joined by Zenoh and by MAVLink over UDP."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec
import numpy as np
import tomli_w

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.hil_sim.autopilot.udp import AutopilotOnTheNet
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.app.session import INPUTS
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.errors import LinkError
from twinscrew.runtime.link.sockets import UdpTransport
from twinscrew.runtime.messages.types import Float64, Odometry

LOOPBACK = "127.0.0.1"
START_LIMIT_S = 20.0
"""[s] How long the runtimes may take to listen."""
STOP_LIMIT_S = 5.0
"""[s] How long they may take to stop."""
SETTLE_S = 0.5
"""[s] An autopilot is ready when it has been armed this long."""
LOG_TAIL = 400
"""[characters] Of a dead runtime's last words to repeat."""


class RealtimeCrew:
    """All vessels' runtimes as processes, and their autopilots; a context."""

    exchange_s = 0.01

    def __init__(
        self,
        configs: list[RuntimeConfig],
        folders: list[Path],
        *,
        autopilot: RoverAutopilotSettings | None = None,
    ) -> None:
        """Prepare the crew.

        Parameters
        ----------
        configs
            The runtimes' configurations; their connections are filled in here.
        folders
            Where each vessel's configuration and log are written.
        """
        self._configs = configs
        self._folders = folders
        self._autopilot = autopilot or RoverAutopilotSettings()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._pilots: list[AutopilotOnTheNet] = []
        self._ready_since: dict[int, float] = {}
        self._now_s = 0.0
        self._begin_s: float | None = None
        self.late_s = 0.0
        """[s] The most that simulated time fell behind the clock."""

    def __enter__(self) -> Self:
        endpoint = f"tcp/{LOOPBACK}:{free_port()}"
        names = [config.name for config in self._configs]
        bus = ZenohBus(ZenohSettings(listen=(endpoint,), connect=()), names[0])
        self._buses = [bus.within(name) for name in names]
        try:
            for config, folder in zip(self._configs, self._folders, strict=True):
                self._start(config, folder, endpoint)
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
        """See `Crew`."""
        self._buses[vessel].publish(topic, payload)

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Crew`."""
        self._now_s = now_s
        self._pilots[vessel].step(now_s, odometry)
        rover = self._pilots[vessel].autopilot.rover
        if rover.armed and rover.mode is Mode.MANUAL:
            self._ready_since.setdefault(vessel, now_s)
        else:
            self._ready_since.pop(vessel, None)

    def is_ready(self, vessel: int) -> bool:
        """See `Crew`."""
        since_s = self._ready_since.get(vessel)
        return since_s is not None and self._now_s - since_s >= SETTLE_S

    def thrust_N(self) -> Float64:
        """See `Crew`."""
        return np.array([pilot.autopilot.thrust_command_N() for pilot in self._pilots])

    def retire(self, vessel: int) -> None:
        """Let the runtime run on: its inputs have stopped, and it must cope with that."""

    def keep_pace(self, now_s: float) -> None:
        """See `Crew`."""
        clock_s = time.monotonic()
        if self._begin_s is None:
            self._begin_s = clock_s - now_s
        ahead_s = self._begin_s + now_s - clock_s
        if ahead_s > 0:
            time.sleep(ahead_s)
        else:
            self.late_s = max(self.late_s, -ahead_s)

    def check(self) -> None:
        """See `Crew`."""
        for config, folder, process in zip(
            self._configs, self._folders, self._processes, strict=True
        ):
            if process.poll() is not None:
                words = (folder / "log.txt").read_text(errors="replace")[-LOG_TAIL:].strip()
                raise LinkError(
                    f"the runtime of {config.name} ended with status {process.returncode}: {words}"
                )

    @property
    def pids(self) -> tuple[int, ...]:
        """The runtimes' process ids."""
        return tuple(process.pid for process in self._processes)

    def close(self) -> None:
        """Stop every process, and wait for it."""
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            try:
                process.wait(STOP_LIMIT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        for pilot in self._pilots:
            pilot.close()
        self._buses[0].close()

    def _start(self, config: RuntimeConfig, folder: Path, endpoint: str) -> None:
        transport = UdpTransport(LOOPBACK, 0, listens=True)
        pilot = RoverAutopilot(self._autopilot, config.autopilot.system_id)
        self._pilots.append(AutopilotOnTheNet(pilot, transport))
        connection = f"udpout:{LOOPBACK}:{transport.port}"
        complete = msgspec.structs.replace(
            config,
            autopilot=msgspec.structs.replace(config.autopilot, connection=connection),
            bus=msgspec.structs.replace(config.bus, connect=(endpoint,)),
        )
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "runtime.toml"
        file.write_text(tomli_w.dumps(_without_none(msgspec.to_builtins(complete))))
        command = [sys.executable, "-m", "twinscrew.runtime.app", "run", "--config", str(file)]
        with (folder / "log.txt").open("wb") as log:
            self._processes.append(subprocess.Popen(command, stdout=log, stderr=log))

    def _wait_for_runtimes(self) -> None:
        for config, bus in zip(self._configs, self._buses, strict=True):
            deadline_s = time.monotonic() + START_LIMIT_S
            while not bus.wait_for_subscribers(INPUTS, 0.2):
                self.check()
                if time.monotonic() > deadline_s:
                    raise LinkError(
                        f"the runtime of {config.name} does not listen after {START_LIMIT_S:g} s"
                    )


def _without_none(values: dict[str, Any]) -> dict[str, Any]:
    """Leave out what is not set: TOML has no word for it."""
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in values.items()
        if value is not None
    }


def free_port() -> int:
    """Give a TCP port that nobody uses now."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])

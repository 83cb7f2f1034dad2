"""ArduRover's simulator as a process: its parameters, its command line, its ports."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from twinscrew.hil_sim.autopilot.parameters import SHIPPED, SIMULATION
from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.children import end_all
from twinscrew.hil_sim.last_words import ended
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.ardupilot.parameters import read_parm

HOST = "127.0.0.1"
INSTANCE_PORTS = 10
"""[-] ArduPilot's simulator adds this times its instance number to all of its ports."""
PHYSICS_PORT = 9002
"""UDP port of the physics, instance 0."""
MAVLINK_PORT = 5760
"""TCP port of its first serial port, instance 0; it waits there for a connection at start-up."""
PARAMETERS_FILE = "ardurover.parm"
MEMORY_FILE = "eeprom.bin"
LOG_FILE = "ardurover.txt"
STOP_LIMIT_S = 2.0
"""[s] How long all of them may take to stop. One that waits for its physics never does: it has
nothing left to write."""


@dataclass(frozen=True, slots=True)
class Instance:
    """One ArduPilot simulator among several on a machine."""

    number: int
    system_id: int
    folder: Path
    """Where its parameters, its memory (eeprom.bin) and its logs are."""
    ground: str = ""
    """HOST:PORT where a ground station listens; its second serial port calls it (UDP)."""
    memory: Path | None = None
    """Where its memory is instead, from run to run: parameters that were written last."""

    @property
    def physics_port(self) -> int:
        """UDP port where the physics listens."""
        return PHYSICS_PORT + INSTANCE_PORTS * self.number

    @property
    def connection(self) -> str:
        """Where its MAVLink is."""
        return f"tcp:{HOST}:{MAVLINK_PORT + INSTANCE_PORTS * self.number}"

    def command(self, binary: str, origin: Origin | None = None) -> list[str]:
        """Give the words that start it, in its folder."""
        place = origin or Origin()
        home = f"{place.latitude_deg},{place.longitude_deg},{place.altitude_m},0"
        words = ["--model", f"JSON:{HOST}", "--instance", str(self.number)]
        words += ["--sysid", str(self.system_id), "--speedup", "1"]
        if self.ground:
            words += ["--serial1", f"udpclient:{self.ground}"]
        wipe = [] if (self.home / MEMORY_FILE).exists() and self.memory else ["--wipe"]
        return [binary, *words, *wipe, "--home", home, "--defaults", PARAMETERS_FILE]

    @property
    def home(self) -> Path:
        """Where it runs: its memory and its parameters are there."""
        return self.folder if self.memory is None else self.memory

    def command_line(self, binary: str) -> str:
        """Give what a user types in a shell."""
        return f"cd {shlex.quote(str(self.home.resolve()))} && {shlex.join(self.command(binary))}"

    def write_parameters(self) -> None:
        """Write its parameters into its folder: the shipped ones, with its own system id.

        With them those of config/autopilot/simulation.parm, which only a simulator may have:
        without them it could not be armed. Firmware 4.7 has new names for the two ids; each version
        passes over the other's names.
        """
        own = float(self.system_id)
        ids = dict.fromkeys(("SYSID_THISMAV", "SYSID_MYGCS", "MAV_SYSID", "MAV_GCS_SYSID"), own)
        values = {**read_parm(SHIPPED), **read_parm(SIMULATION), **ids}
        lines = [f"{name} {value:g}\n" for name, value in values.items()]
        for folder in (self.folder, self.home):
            folder.mkdir(parents=True, exist_ok=True)
        (self.home / PARAMETERS_FILE).write_text("".join(lines))


class Process:
    """A running ArduPilot simulator that we started."""

    def __init__(self, instance: Instance, binary: Path) -> None:
        """Start it.

        Raises
        ------
        ConfigError
            The binary cannot be started.
        """
        self._log = instance.folder / LOG_FILE
        self._name = f"instance {instance.number}"
        command = instance.command(str(binary.resolve()))
        try:
            with self._log.open("wb") as log:
                self.process = subprocess.Popen(
                    command, cwd=instance.home, stdin=subprocess.DEVNULL, stdout=log, stderr=log
                )
        except OSError as error:
            raise ConfigError(f"cannot be started: {error.strerror}", file=binary) from error

    def check(self) -> None:
        """Raise a `LinkError`, with its last words, if it has ended."""
        if self.process.poll() is not None:
            raise ended(f"ArduPilot's {self._name}", self.process, self._log.read_bytes())


def close_all(processes: Sequence[Process]) -> None:
    """Stop several at the same time, and wait for them."""
    end_all([process.process for process in processes], STOP_LIMIT_S)

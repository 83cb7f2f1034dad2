"""Lock-step: the runtimes of all vessels in this process, each step when it is its turn.

The same code as on the boat, with the same bytes in and out; only the sockets and the clock are
missing. Everything is determined by the seed.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.drivers.voyage import ODOMETRY_S
from twinscrew.runtime.app.assemble import make_controller
from twinscrew.runtime.app.config import RuntimeConfig, sensor_of
from twinscrew.runtime.app.latency import Latencies
from twinscrew.runtime.app.outlet import Outlet
from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.app.session import inputs_of, metadata_of
from twinscrew.runtime.app.transforms import Frames
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND, Float64, Odometry


class LockstepVessel:
    """One vessel's runtime and its autopilot, joined by bytes."""

    def __init__(
        self, config: RuntimeConfig, autopilot: RoverAutopilotSettings, *, epoch_ns: int
    ) -> None:
        self.config = config
        self.controller = make_controller(config)
        self.autopilot = RoverAutopilot(autopilot, config.autopilot.system_id)
        self.latencies = Latencies()
        self._epoch_ns = epoch_ns
        self._now_s = 0.0
        self._recorder = self._open_recorder()
        self.outlet = Outlet(
            None,
            self._recorder,
            vessel=config.name,
            frames=Frames(sensor_of(config)),
            clock_ns=self._log_time,
        )

    def deliver(self, topic: str, payload: bytes, now_s: float) -> None:
        """Hand a message to the runtime, and what it commands at once to the autopilot."""
        if topic in inputs_of(self.config):
            self._feed(topic, payload, now_s)

    def _feed(self, topic: str, payload: bytes, now_s: float) -> None:
        self._now_s = now_s
        begin_ns = time.perf_counter_ns()
        self.outlet.record(topic, payload)
        handled = self.controller.take_in(topic, payload, self._now_s)
        if handled.decision is not None:
            command = self.controller.command(self._now_s)
            self.latencies.add((time.perf_counter_ns() - begin_ns) / 1e6)
            self.autopilot.receive(command, self._now_s)
            self.outlet.decided(handled.decision, self.controller.thrust)
        self.outlet.happened(handled.events)

    def exchange(self, now_s: float, odometry: Odometry) -> None:
        """Let the autopilot and the runtime talk once."""
        self._now_s = now_s
        controller = self.controller
        controller.from_autopilot(self.autopilot.step(now_s, odometry), now_s)
        for payload in controller.own_odometry():
            self._feed("odometry", payload, now_s)
        engagement, events = controller.supervise(now_s)
        if engagement is not None:
            self.outlet.record("engagement", engagement)
            controller.take_in("engagement", engagement, now_s)
        self.outlet.happened(events)
        self.autopilot.receive(controller.command(now_s), now_s)

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder is not None:
            self._recorder.close()

    def _log_time(self) -> int:
        return self._epoch_ns + round(self._now_s * NANOSECONDS_PER_SECOND)

    def _open_recorder(self) -> Recorder | None:
        folder = self.config.recording.folder
        if not folder:
            return None
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        metadata = metadata_of(self.config, self.controller.core.pipeline.policy)
        return Recorder(path / "recording", self.config.name, metadata, lossless=True)


class LockstepCrew:
    """All vessels' runtimes, in this process."""

    exchange_s = ODOMETRY_S

    def __init__(
        self,
        configs: list[RuntimeConfig],
        *,
        epoch_ns: int,
        autopilot: RoverAutopilotSettings | None = None,
    ) -> None:
        settings = autopilot or RoverAutopilotSettings()
        self.vessels = [LockstepVessel(config, settings, epoch_ns=epoch_ns) for config in configs]

    def deliver(self, vessel: int, topic: str, payload: bytes, now_s: float) -> None:
        """See `Crew`."""
        self.vessels[vessel].deliver(topic, payload, now_s)

    def exchange(self, vessel: int, now_s: float, odometry: Odometry) -> None:
        """See `Crew`."""
        self.vessels[vessel].exchange(now_s, odometry)

    def is_ready(self, vessel: int) -> bool:
        """See `Crew`."""
        return self.vessels[vessel].controller.engaged

    def thrust_N(self) -> Float64:
        """See `Crew`."""
        return np.array([vessel.autopilot.thrust_command_N() for vessel in self.vessels])

    def retire(self, vessel: int) -> None:
        """See `Crew`."""
        self.vessels[vessel].close()

    def keep_pace(self, now_s: float) -> None:
        """Wait for nothing: simulated time is as fast as the machine."""

    def check(self) -> None:
        """Nothing can have died but this process."""

    def close(self) -> None:
        """Finish all recordings."""
        for vessel in self.vessels:
            vessel.close()

"""One vessel's runtime that moves only when it is told to: for simulated time.

The same controller, outlet and recorder as on the boat, with the same bytes in and out; only the
sockets and the clock are missing. A simulator steps it in its own process, or in another one
(`stepped_process`), to the same decisions.
"""

from __future__ import annotations

import time
from pathlib import Path

from twinscrew.runtime.app.assemble import make_controller
from twinscrew.runtime.app.config import RuntimeConfig, sensor_of
from twinscrew.runtime.app.latency import Latencies
from twinscrew.runtime.app.outlet import Outlet
from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.app.session import RunSummary, inputs_of, metadata_of
from twinscrew.runtime.app.transforms import Frames
from twinscrew.runtime.messages.types import NANOSECONDS_PER_SECOND


class SteppedRuntime:
    """One vessel's runtime, without sockets and clock."""

    def __init__(self, config: RuntimeConfig, *, epoch_ns: int) -> None:
        """Assemble it.

        Parameters
        ----------
        config
            The vessel's configuration; what it says of connections is not used.
        epoch_ns
            [ns] The simulation's begin, for the recording's log times.
        """
        self.config = config
        self.controller = make_controller(config, looks_first=False)
        self.latencies = Latencies()
        self._inputs = inputs_of(config)
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

    @property
    def engaged(self) -> bool:
        """Whether the policy has the propellers."""
        return self.controller.engaged

    def deliver(self, topic: str, payload: bytes, now_s: float) -> bytes:
        """Take in a message, and give the MAVLink bytes that it makes us send at once."""
        if topic not in self._inputs:
            return b""
        sent = self._own_odometry(now_s) if topic == "points" else []
        return b"".join([*sent, self._feed(topic, payload, now_s)])

    def exchange(self, data: bytes, now_s: float) -> bytes:
        """Take in MAVLink bytes, and give those that answer them."""
        self._now_s = now_s
        controller = self.controller
        controller.from_autopilot(data, now_s)
        sent = self._own_odometry(now_s)
        engagement, events = controller.supervise(now_s)
        if engagement is not None:
            self.outlet.record("engagement", engagement)
            controller.take_in("engagement", engagement, now_s)
        self.outlet.happened(events)
        return b"".join([*sent, controller.command(now_s)])

    def summary(self) -> RunSummary:
        """Say what happened so far."""
        return RunSummary(
            name=self.config.name,
            decisions=self.outlet.decisions,
            decisions_sha256=self.outlet.sha256,
            latency_ms=self.latencies.summary().as_dict(),
            wire_latency_ms=Latencies().summary().as_dict(),
            overruns=0,
            passed_over={},
            unrecorded=0,
        )

    def close(self) -> None:
        """Finish the recording."""
        if self._recorder is not None:
            self._recorder.close()

    def _own_odometry(self, now_s: float) -> list[bytes]:
        return [self._feed("odometry", own, now_s) for own in self.controller.own_odometry()]

    def _feed(self, topic: str, payload: bytes, now_s: float) -> bytes:
        self._now_s = now_s
        begin_ns = time.perf_counter_ns()
        self.outlet.record(topic, payload)
        handled = self.controller.take_in(topic, payload, now_s)
        command = b""
        if handled.decision is not None:
            command = self.controller.command(now_s)
            self.latencies.add((time.perf_counter_ns() - begin_ns) / 1e6)
            why = self.controller.explain(handled.decision) if self.outlet.is_told else None
            self.outlet.decided(handled.decision, self.controller.thrust, why)
        self.outlet.happened(handled.events)
        return command

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

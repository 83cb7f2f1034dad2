"""One run of a vessel's runtime: opens everything, closes everything, writes the summary."""

from __future__ import annotations

import platform
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec

from twinscrew.runtime.app.assemble import make_controller
from twinscrew.runtime.app.config import RuntimeConfig, sensor_of
from twinscrew.runtime.app.garbage import Garbage
from twinscrew.runtime.app.ground import GroundReport
from twinscrew.runtime.app.latency import Latencies
from twinscrew.runtime.app.loop import Loop
from twinscrew.runtime.app.odometry_source import SENSED
from twinscrew.runtime.app.outlet import Outlet
from twinscrew.runtime.app.recorder import Recorder
from twinscrew.runtime.app.transforms import Frames
from twinscrew.runtime.bus.base import Inbox
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import ConfigError, RecordingError
from twinscrew.runtime.link.transport import await_transport, reopening
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.safety.events import FILES_APPROVED, PRIORITY_REFUSED

INPUTS = ("points", "odometry", "goal", "route")
SUMMARY_FILE = "runtime.json"


def inputs_of(config: RuntimeConfig) -> tuple[str, ...]:
    """Give the topics that a runtime listens to."""
    if config.odometry_source == "bus":
        return INPUTS
    rest = tuple(topic for topic in INPUTS if topic != "odometry")
    return (*rest, *SENSED) if config.odometry_source == "gps_imu" else rest


class RunSummary(msgspec.Struct, frozen=True, kw_only=True):
    """What a runtime says of itself when it stops."""

    name: str
    decisions: int
    decisions_sha256: str
    latency_ms: dict[str, float]
    """From a scan's arrival to the MAVLink bytes on the socket."""
    wire_latency_ms: dict[str, float]
    """From the sender's Zenoh put to the MAVLink bytes on the socket."""
    overruns: int
    """Decisions that came too late."""
    missed_ticks: int = 0
    """Ticks of the loop's grid that passed while it was held up."""
    priority_refused: tuple[str, ...] = ()
    """What the system did not allow of the priority and cores that were asked for."""
    passed_over: dict[str, int]
    """Messages that newer ones replaced before they were read."""
    unrecorded: int
    """Messages that the recorder had to drop."""


def read_summary(folder: Path) -> RunSummary:
    """Read what a runtime said of itself when it stopped.

    Raises
    ------
    RecordingError
        There is none: it did not stop by itself.
    """
    path = folder / SUMMARY_FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=RunSummary)
    except (OSError, ValueError, RecursionError) as error:  # nested too deep, for the last
        raise RecordingError(f"{path}: the runtime left no summary ({error})") from error


def nothing_told(name: str) -> RunSummary:
    """Give the summary of a runtime that was killed and left none."""
    return RunSummary(
        name=name,
        decisions=0,
        decisions_sha256="",
        latency_ms=Latencies().summary().as_dict(),
        wire_latency_ms=Latencies().summary().as_dict(),
        overruns=0,
        passed_over={},
        unrecorded=0,
    )


def metadata_of(config: RuntimeConfig, policy: Policy) -> dict[str, Any]:
    """Give what a replay must know: configuration, the policy's hash (if it is a file), machine."""
    return {
        "config": msgspec.to_builtins(config),
        "policy_sha256": getattr(policy, "sha256", ""),
        "platform": {
            "python": platform.python_version(),
            "architecture": platform.machine(),
            "libc": " ".join(platform.libc_ver()),
        },
    }


def unused(folder: Path) -> Path:
    """Give the folder, or the first of folder-2, folder-3, ... that is not there or is empty.

    A boat that starts again keeps what it recorded before, and is not kept from starting by it.
    """
    candidate, number = folder, 1
    while candidate.exists() and any(candidate.iterdir()):
        number += 1
        candidate = folder.with_name(f"{folder.name}-{number}")
    return candidate


class Session:
    """A context: everything is open inside it."""

    def __init__(
        self,
        config: RuntimeConfig,
        *,
        source: Path,
        stop: Callable[[], bool] = lambda: False,
        refused: tuple[str, ...] = (),
        approval: str = "",
    ) -> None:
        """Prepare a run.

        Parameters
        ----------
        stop
            Ends the wait for an autopilot that is not there yet.
        refused
            What of the priority the system did not give (`priority.take`): it is told.
        approval
            Who stands for the files that were read, if anybody: it is told.
        """
        self._stop = stop
        self._refused = refused
        self._approval = approval
        self._config = config
        self._source = source
        self._folder = Path(config.recording.folder) if config.recording.folder else None
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        try:
            self._open()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.close()

    def write_summary(self) -> RunSummary:
        """Write what happened beside the recording, and give it."""
        summary = RunSummary(
            name=self._config.name,
            decisions=self._outlet.decisions,
            decisions_sha256=self._outlet.sha256,
            latency_ms=self.loop.latencies.summary().as_dict(),
            wire_latency_ms=self.loop.wire_latencies.summary().as_dict(),
            overruns=self.loop.overruns,
            missed_ticks=self.loop.missed_ticks,
            priority_refused=self._refused,
            passed_over=dict(self._inbox.passed_over),
            unrecorded=self._recorder.dropped if self._recorder else 0,
        )
        if self._folder is not None:
            content = msgspec.json.format(msgspec.json.encode(summary))
            (self._folder / SUMMARY_FILE).write_bytes(content + b"\n")
        return summary

    def _open(self) -> None:
        config = self._config
        link = config.autopilot
        controller = make_controller(config)
        known = controller.link.recognises
        opened = await_transport(link.connection, link.wait_s, self._stop, known)
        transport = reopening(link.connection, opened, known)
        self._stack.callback(transport.close)
        controller.core.pipeline.warm_up()
        bus = ZenohBus(config.bus, config.name)
        self._stack.callback(bus.close)
        self._recorder = self._open_recorder(controller.core.pipeline.policy)
        self._outlet = Outlet(
            bus, self._recorder, vessel=config.name, frames=Frames(sensor_of(config))
        )
        self._inbox = Inbox()
        self.loop = Loop(
            controller,
            self._inbox,
            transport,
            self._outlet,
            rate_hz=config.command_rate_hz,
            ground=GroundReport(
                config.ground,
                link.datum,
                link.system_id,
                sees_m=config.perception.max_range_m,
            ),
        )
        if self._refused:
            told = PRIORITY_REFUSED.at(controller.stamp_ns, "; ".join(self._refused))
            self._outlet.happened((told,))
        if self._approval:
            self._outlet.happened((FILES_APPROVED.at(controller.stamp_ns, self._approval),))
        self._stack.enter_context(
            Garbage()
        )  # the first collection takes 20 ms: before a scan comes
        self._inbox.listen(bus, inputs_of(config))

    def _open_recorder(self, policy: Policy) -> Recorder | None:
        if self._folder is None:
            return None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(
                f"{self._folder}: {error.strerror}", file=self._source, key="recording.folder"
            ) from error
        metadata = metadata_of(self._config, policy)
        return self._stack.enter_context(
            Recorder(
                unused(self._folder / "recording"),
                self._config.name,
                metadata,
                self._config.recording,
            )
        )

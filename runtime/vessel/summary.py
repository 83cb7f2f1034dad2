"""What a run is summed up by: latencies, decisions, losses; and what a replay must know of it."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.vessel.config import RuntimeConfig

SUMMARY_FILE: Final = "runtime.json"


@dataclass(frozen=True, slots=True)
class LatencySummary:
    """Percentiles of latencies [ms]."""

    count: int
    p50: float
    p99: float
    p999: float
    max: float

    def as_dict(self) -> dict[str, float]:
        """Give the percentiles alone, for JSON."""
        return {"p50": self.p50, "p99": self.p99, "p999": self.p999, "max": self.max}


class Latencies:
    """Counts latencies in bins a tenth of a per cent wide; the greatest is kept exactly.

    Memory does not grow with the run.
    """

    LEAST_MS = 1e-3
    RATIO = 1.001
    BINS = 18_000  # to 65 s

    def __init__(self) -> None:
        self._counts: NDArray[np.int64] = np.zeros(self.BINS, dtype=np.int64)
        self._max_ms = 0.0

    def add(self, latency_ms: float) -> None:
        """Count one latency."""
        bin_ = int(np.log(max(latency_ms, self.LEAST_MS) / self.LEAST_MS) / np.log(self.RATIO))
        self._counts[min(bin_, self.BINS - 1)] += 1
        self._max_ms = max(self._max_ms, latency_ms)

    def summary(self) -> LatencySummary:
        """Give the percentiles so far; all zero if there is none."""
        count = int(self._counts.sum())
        if count == 0:
            return LatencySummary(0, 0.0, 0.0, 0.0, 0.0)
        ends = np.cumsum(self._counts)
        p50, p99, p999 = (self._at(ends, share * count) for share in (0.5, 0.99, 0.999))
        return LatencySummary(count, p50, p99, p999, self._max_ms)

    def _at(self, ends: NDArray[np.int64], rank: float) -> float:
        bin_ = int(np.searchsorted(ends, rank))
        return float(min(self.LEAST_MS * self.RATIO ** (bin_ + 0.5), self._max_ms))


NO_LATENCY: Final = Latencies().summary().as_dict()


class RunSummary(msgspec.Struct, frozen=True, kw_only=True):
    """What a runtime writes of itself when it stops; the defaults are those of a killed one."""

    name: str
    decisions: int = 0
    decisions_sha256: str = ""
    latency_ms: dict[str, float] = msgspec.field(default_factory=NO_LATENCY.copy)
    """From a scan's arrival to the MAVLink bytes on the socket."""
    wire_latency_ms: dict[str, float] = msgspec.field(default_factory=NO_LATENCY.copy)
    """From the sender's Zenoh put to the MAVLink bytes on the socket."""
    overruns: int = 0
    """Decisions that came too late."""
    missed_ticks: int = 0
    """Ticks of the loop's grid that passed while it was held up."""
    priority_refused: tuple[str, ...] = ()
    """What the system did not allow of the priority and cores that were asked for."""
    passed_over: dict[str, int] = msgspec.field(default_factory=dict)
    """Messages that newer ones replaced before they were read."""
    unrecorded: int = 0
    """Messages that the recorder had to drop."""


def write_summary(summary: RunSummary, folder: Path) -> None:
    """Write a summary beside the recording."""
    content = msgspec.json.format(msgspec.json.encode(summary))
    (folder / SUMMARY_FILE).write_bytes(content + b"\n")


def read_summary(folder: Path) -> RunSummary:
    """Read the summary that a runtime wrote when it stopped.

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

"""How recordings are kept: light to import, because every configuration holds them."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, field

from twinscrew.runtime.settings import Count, Positive, Settings


class BagSettings(Settings, frozen=True):
    """How recordings are kept on the disk."""

    rotate_mb: Positive = 1000.0
    """[MB] A file that has grown to this is closed and the next begun."""
    rotate_s: Positive = 600.0
    """[s] So is a file of this age, by the messages' times."""
    quota_mb: Positive = 20_000.0
    """[MB] Beyond this the oldest files of the recording are deleted."""
    chunk_kb: Count = 8
    """[kB] Size of a chunk: what a crash can cost. A larger message is a chunk of its own."""
    compression: Literal["none", "lz4", "zstd"] = "none"
    """zstd takes some 20 % off clouds of float32, for about 1 ms a scan."""


class RecorderSettings(BagSettings, frozen=True):
    """How a run is recorded."""

    queue_mb: Positive = 64.0
    """[MB] What may wait for the disk; messages beyond it are dropped and counted."""
    flush_s: Annotated[float, Meta(gt=0.0, le=60.0)] = 0.25
    """[s] How often what waits is written: how much `kill -9` can cost, besides a chunk."""


class RecordingSettings(RecorderSettings, frozen=True):
    """What is kept of a run."""

    folder: str = ""
    """Where the recording (rosbag2, MCAP) and the summary go; empty: nothing is kept."""
    about: dict[str, str] = field(default_factory=dict)
    """What else a reader should know: a simulator says scenario and seed here."""

"""What is soaked, and what may not be exceeded: config/soak.toml."""

from __future__ import annotations

from twinscrew.runtime.app.recording_settings import RecorderSettings
from twinscrew.runtime.settings import CONFIG_DIR, Count, Fraction, NonNegative, Positive, Settings
from twinscrew.runtime.settings import load as load_settings

SHIPPED = CONFIG_DIR / "soak.toml"


class Limits(Settings, frozen=True):
    """What a runtime that is well does not exceed."""

    memory_mb_per_h: Positive = 30.0
    """[MB/h] Growth of resident memory."""
    memory_slack_mb: NonNegative = 4.0
    """[MB] Less than this is no growth, however short the run."""
    files: NonNegative = 4
    """[-] File handles more than when it was warm."""
    threads: NonNegative = 4
    """[-] Threads more, likewise."""
    missed_share: Fraction = 0.001
    """[-] Of decisions, while no fault acts on the vessel and the machine runs, that came later
    than the next scan."""
    judged_share: Fraction = 0.5
    """[-] Of a vessel's faults, at least, that can be judged: it was under way, the machine ran."""
    standstill_share: Fraction = 0.01
    """[-] Of the time that a core stood still, at most: what was measured is worth little else."""


class SoakSettings(Settings, frozen=True):
    """A soak."""

    vessels: Count = 3
    """[-] Only the first one's runtime is ever killed."""
    sample_s: Positive = 2.0
    """[s] Between two samples of memory, file handles and threads."""
    pause_s: tuple[NonNegative, Positive] = (2.0, 8.0)
    """[s] Between two faults, at least and at most."""
    warm_share: Fraction = 0.4
    """[-] Share of the run after which growth counts."""
    limits: Limits = Limits()
    recording: RecorderSettings = RecorderSettings(rotate_mb=10.0, rotate_s=60.0, quota_mb=100.0)


def load_soak() -> SoakSettings:
    """Read the shipped settings."""
    return load_settings(SHIPPED, SoakSettings)

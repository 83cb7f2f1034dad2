"""One episode's results, as they stand in a line of results.jsonl."""

from __future__ import annotations

from typing import Literal

from twinscrew.hil_sim.experiments.plan import Key
from twinscrew.runtime.settings import Settings

Cause = Literal["vessel", "buoy", "time"]


class VesselRecord(Settings, frozen=True, kw_only=True):
    """How one vessel fared."""

    outcome: Literal["goal", "collision", "timeout"]
    touched: Literal["vessel", "buoy", "quay"] | None = None
    """What it hit, if it did."""
    travel_time_s: float
    """[s] Simulated time to the outcome."""
    closest_approach_m: float | None
    """[m] Least distance to another's surface while under way; None if nobody else is there."""
    energy_ns: float
    """[N s] Integral of |T| dt over both propellers."""
    decisions: int
    interventions: int = 0
    """[-] How often the assurance took the propellers from the policy."""


class EncounterRecord(Settings, frozen=True, kw_only=True):
    """One vessel's part in an encounter; see `encounters.Encounter`."""

    kind: Literal["head_on", "give_way"]
    ego: int
    other: int
    begin_s: float
    end_s: float
    acted: bool
    touched: bool
    gap_m: float
    rule_gap_m: float


class Timing(Settings, frozen=True, kw_only=True):
    """What depends on the machine and its load, and on nothing else."""

    decision_p50_ms: float
    """[ms] From a scan's bytes to the thrust command's, the slowest vessel's."""
    decision_p99_ms: float
    decision_max_ms: float
    wall_s: float
    simulated_s: float


class EpisodeRecord(Settings, frozen=True, kw_only=True):
    """One episode."""

    method: str
    set: str
    variant: str
    episode: int
    seed: int
    """What `twinscrew sitl --lockstep --seed` takes to sail it again."""
    success: bool
    cause: Cause | None
    """Why it failed, by its first failure."""
    vessels: tuple[VesselRecord, ...]
    encounters: tuple[EncounterRecord, ...]
    decisions_sha256: str
    """Over all vessels' decisions: equal if and only if all were equal bit for bit."""
    timing: Timing

    @property
    def key(self) -> Key:
        """Which episode it is."""
        return Key(self.method, self.set, self.variant, self.episode)

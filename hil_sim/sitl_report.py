"""How a run of software in the loop went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from twinscrew.hil_sim.drivers.voyage import VoyageResult
from twinscrew.hil_sim.faults.verdict import Verdict
from twinscrew.runtime.vessel.replay import combined_sha256
from twinscrew.runtime.vessel.summary import LatencySummary, RunSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class VesselReport:
    """How one vessel fared, and its runtime."""

    name: str
    outcome: str
    travel_time_s: float
    closest_approach_m: float
    touched: str | None
    """What it was in contact with when it ended: vessel, traffic, buoy, quay or fence."""
    greatest_current_mps: float
    """[m/s] The fastest water it was in."""
    decisions: int
    latency: LatencySummary
    energy_ns: float
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SitlReport:
    """How a run went."""

    success: bool
    seed: int
    vessels: tuple[VesselReport, ...]
    real_time_factor: float
    wall_s: float
    """[s] From the start to the last vessel's outcome."""
    verdicts: tuple[tuple[str, Verdict], ...] = ()
    """By vessel: what was promised in case of faults, and what was measured."""

    @property
    def kept(self) -> bool:
        """Whether every promise was kept; true without faults."""
        return all(verdict.kept for _, verdict in self.verdicts)

    @property
    def sha256(self) -> str:
        """SHA-256 over all vessels' decisions."""
        return combined_sha256(vessel.sha256 for vessel in self.vessels)


def vessel_reports(result: VoyageResult, runs: Sequence[RunSummary]) -> tuple[VesselReport, ...]:
    """Join what the simulator saw of every vessel and what its runtime told."""
    energy = result.log.energy_ns()
    return tuple(
        VesselReport(
            name=vessel.name,
            outcome=vessel.outcome.value if vessel.outcome else "timeout",
            travel_time_s=vessel.travel_time_s,
            closest_approach_m=vessel.closest_approach_m,
            touched=vessel.touched,
            greatest_current_mps=vessel.greatest_current_mps,
            decisions=run.decisions,
            latency=LatencySummary(run.decisions, **run.latency_ms),
            energy_ns=float(energy[i]),
            sha256=run.decisions_sha256,
        )
        for i, (vessel, run) in enumerate(zip(result.results, runs, strict=True))
    )

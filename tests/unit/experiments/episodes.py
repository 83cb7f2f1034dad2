"""Records of episodes that nobody sailed, for tests of what is done with records."""

from msgspec.structs import replace

from twinscrew.hil_sim.experiments.results import (
    EncounterRecord,
    EpisodeRecord,
    Timing,
    VesselRecord,
)

TIMING = Timing(
    decision_p50_ms=0.5, decision_p99_ms=1.0, decision_max_ms=2.0, wall_s=2.0, simulated_s=40.0
)


def vessel(outcome="goal", travel_time_s=20.0, touched=None, near=2.0, energy_ns=30e3):
    return VesselRecord(
        outcome=outcome,
        touched=touched,
        travel_time_s=travel_time_s,
        closest_approach_m=near,
        energy_ns=energy_ns,
        decisions=200,
    )


def encounter(kind="head_on", acted=True, gap_m=3.0, rule_gap_m=2.0, touched=False):
    return EncounterRecord(
        kind=kind,
        ego=0,
        other=1,
        begin_s=1.0,
        end_s=4.0,
        acted=acted,
        touched=touched,
        gap_m=gap_m,
        rule_gap_m=rule_gap_m,
    )


def episode(number=0, method="a", vessels=None, cause=None, encounters=(), **changes):
    made = EpisodeRecord(
        method=method,
        set="one",
        variant="full",
        episode=number,
        seed=7,
        success=cause is None,
        cause=cause,
        vessels=(vessel(), vessel()) if vessels is None else vessels,
        encounters=encounters,
        decisions_sha256="0" * 64,
        timing=TIMING,
    )
    return replace(made, **changes)

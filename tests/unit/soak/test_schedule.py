import numpy as np
import pytest

from twinscrew.hil_sim.faults.plan import load_plan
from twinscrew.hil_sim.soak.run import plans_for
from twinscrew.hil_sim.soak.vessels import draw, joined, spares_the_runtime, waits

HOUR_S = 3600.0
PAUSE_S = (2.0, 8.0)


def drawn(seed: int, duration_s: float = HOUR_S):
    return draw(plans_for(0), duration_s, PAUSE_S, np.random.default_rng(seed))


def test_the_same_seed_draws_the_same_faults_and_another_one_others() -> None:
    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)


def test_one_fault_settles_before_the_next_begins() -> None:
    schedule = drawn(3)
    settled = [one.plan.end_s + one.plan.settle_s for one in schedule]
    pauses = [b.begin_s - a for a, b in zip(settled, schedule[1:], strict=False)]
    assert len(schedule) > 150
    assert min(pauses) >= PAUSE_S[0]
    assert max(pauses) <= PAUSE_S[1]
    assert settled[-1] <= HOUR_S


def test_times_within_a_fault_stay_as_they_are() -> None:
    one = next(one for one in drawn(4) if one.plan.name == "autopilot_killed")
    shipped = load_plan("autopilot_killed")
    shift = one.begin_s - shipped.fault[0].at_s
    assert [fault.at_s for fault in one.plan.fault] == pytest.approx(
        [fault.at_s + shift for fault in shipped.fault]
    )


def test_a_vessel_whose_fault_gives_the_goal_itself_waits_for_it() -> None:
    schedule = drawn(5)
    after_s = {"runtime_killed": 10.0, "autopilot_first": goal_after_s("autopilot_first")}
    restarted = [one for one in schedule if one.plan.name in after_s]
    assert {one.plan.name for one in restarted} == set(after_s)
    assert [tuple(span) for span in waits(schedule)] == [
        (one.begin_s, pytest.approx(one.begin_s + after_s[one.plan.name])) for one in restarted
    ]


def goal_after_s(name: str) -> float:
    """Give how long after its first fault a shipped plan gives the goal."""
    faults = load_plan(name).fault
    return next(fault.at_s for fault in faults if fault.kind == "goal") - faults[0].at_s


def test_in_an_hour_nearly_every_fault_comes() -> None:
    assert len({one.plan.name for one in drawn(5)}) > 0.9 * len(plans_for(0))


def test_only_the_first_vessels_runtime_is_killed_and_no_pilot_keeps_a_boat() -> None:
    assert any(not spares_the_runtime(plan) for plan in plans_for(0))
    assert all(spares_the_runtime(plan) for plan in plans_for(1))
    names = {plan.name for plan in plans_for(0)}
    assert "pilot_gives_back" in names
    assert not names & {"pilot_hold", "disarmed", "goal_lost"}


def test_all_faults_make_one_plan() -> None:
    schedule = drawn(6, 120.0)
    assert len(joined(schedule).fault) == sum(len(one.plan.fault) for one in schedule)

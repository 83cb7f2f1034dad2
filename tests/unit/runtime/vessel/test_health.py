import itertools

import pytest

from twinscrew.runtime.safety.events import LIDAR_STALE, OVERRUN
from twinscrew.runtime.vessel.health import Facts, Health, State, state_of

WELL = {
    "inputs_heard": True,
    "inputs_fresh": True,
    "may_drive": True,
    "fault": False,
    "knows_surroundings": True,
    "has_goal": True,
    "warned": False,
}


@pytest.mark.parametrize(
    ("changes", "state"),
    [
        ({}, State.ACTIVE),
        ({"warned": True}, State.DEGRADED),
        ({"has_goal": False}, State.READY),
        ({"may_drive": False}, State.READY),
        ({"inputs_fresh": False}, State.SAFE),
        ({"fault": True}, State.SAFE),
        ({"knows_surroundings": False}, State.SAFE),
        ({"fault": True, "may_drive": False}, State.SAFE),
        ({"inputs_heard": False, "inputs_fresh": False}, State.STANDBY),
    ],
)
def test_the_state_follows_from_the_facts(changes: dict[str, bool], state: State) -> None:
    assert state_of(Facts(**{**WELL, **changes})) is state


def test_every_transition_is_an_event_and_staying_is_none() -> None:
    health = Health()
    event = health.step(Facts(**WELL), 7)
    assert event is not None
    assert (event.name, event.detail, event.stamp_ns) == ("state", "standby -> active", 7)
    assert health.step(Facts(**WELL), 8) is None


def test_a_warning_degrades_for_a_second_and_an_error_is_not_a_warning() -> None:
    health = Health()
    health.note((LIDAR_STALE.at(0),), 0.0)
    assert not health.warned(0.0)
    health.note((OVERRUN.at(0),), 1.0)
    assert health.warned(1.9)
    assert not health.warned(2.1)


def test_standby_is_left_for_good_and_any_other_state_may_follow_any_other() -> None:
    flags = (True, False)
    reached: set[State] = set()
    for fresh, drive, fault, knows, goal, warned in itertools.product(flags, repeat=6):
        facts = Facts(
            inputs_heard=True,
            inputs_fresh=fresh,
            may_drive=drive,
            fault=fault,
            knows_surroundings=knows,
            has_goal=goal,
            warned=warned,
        )
        before = Health()
        for state in (State.READY, State.ACTIVE, State.DEGRADED, State.SAFE, State.STANDBY):
            before.state = state
            before.step(facts, 0)
            assert before.state is state_of(facts)  # whatever was before
        reached.add(state_of(facts))
    assert reached == set(State) - {State.STANDBY}

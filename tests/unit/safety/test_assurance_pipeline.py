"""The assurance where it works: between the policy and the thrust of the pipeline."""

import numpy as np
import pytest
from tests.harness.boat import Steady, cloud, odometry

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.messages.types import Decision, Odometry
from twinscrew.runtime.perception.segmentation import Perception
from twinscrew.runtime.perception.sensor import load_sensor
from twinscrew.runtime.policy.load import Policy
from twinscrew.runtime.safety.assurance import Assurance, AssuranceSettings
from twinscrew.runtime.safety.guard import Guard
from twinscrew.runtime.tracking.tracker import Tracker
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.mission import Mission, MissionSettings
from twinscrew.runtime.vessel.pipeline import Pipeline, make_pipeline


def pipeline(policy: Policy) -> Pipeline:
    return Pipeline(
        perception=Perception(load_sensor("vrx16")),
        tracker=Tracker(),
        policy=policy,
        mission=Mission(MissionSettings(waypoints_m=((500.0, 0.0),))),
        guard=Guard(),
        assurance=Assurance(AssuranceSettings(enabled=True)),
    )


def pillar(ahead_m: float) -> list[tuple[float, float, float]]:
    """Echoes of a buoy's tower, from the sensor 0.43 m ahead of and 1.93 m above the origin."""
    side = np.linspace(-0.5, 0.5, 12)
    depth = 0.5 - np.sqrt(0.25 - side**2)
    return [
        (ahead_m - 0.43 + d, s, down)
        for d, s in zip(depth, side, strict=True)
        for down in (0.4, 0.8, 1.2)
    ]


def moving(time_s: float, surge: float) -> Odometry:
    from dataclasses import replace

    return replace(odometry(time_s), velocity_B=np.array([surge, 0.0, 0.0]))


def approach(boat: Pipeline, buoy_m: float, scans: int, surge: float = 3.0) -> list[Decision]:
    """A buoy that stays as far ahead as it is, whatever the boat does."""
    return [step(boat, k / 10, buoy_m, surge) for k in range(scans)]


def step(
    boat: Pipeline, time_s: float, buoy_m: float, surge: float = 3.0, *, engaged: bool = True
) -> Decision:
    scan = cloud(time_s, pillar(buoy_m))
    return boat.step(scan, moving(time_s, surge), engaged=engaged)[0]


def names(decisions: list[Decision]) -> list[str]:
    return [event.name for decision in decisions for event in decision.events]


def test_braking_begins_at_once_not_at_the_next_decision():
    policy = Steady((1000.0, 1000.0))
    decisions = approach(pipeline(policy), 5.5, 5)
    thrust = [decision.thrust[0] for decision in decisions]
    assert [decision.acted for decision in decisions] == [True, False, False, False, False]
    assert "assurance_intervened" in names(decisions)
    assert thrust[-1] < thrust[0] == 500.0


def test_the_policy_sees_the_thrust_that_acts_not_the_one_it_asked_for():
    policy = Steady((1000.0, 1000.0))
    decisions = approach(pipeline(policy), 6.5, 6)
    seen = decisions[5].observation
    assert seen is not None
    assert seen.ego[5:].tolist() == decisions[4].thrust.tolist()
    assert decisions[5].thrust_rate.tolist() == [1000.0, 1000.0]


def test_an_intervention_is_part_of_the_decision():
    decisions = approach(pipeline(Steady((1000.0, 1000.0))), 6.5, 6)
    told = [event for decision in decisions for event in decision.events]
    (event,) = [event for event in told if event.name == "assurance_intervened"]
    assert "brake" in event.detail


def test_where_nobody_drives_nothing_is_overridden():
    boat = pipeline(Steady((1000.0, 1000.0)))
    decisions = [step(boat, k / 10, 6.0, engaged=False) for k in range(8)]
    assert not np.any([decision.thrust for decision in decisions])
    assert "assurance_intervened" not in names(decisions)


def test_after_a_policys_failure_the_thrust_is_neutral_whatever_is_ahead():
    policy = Steady((1000.0, 1000.0))
    boat = pipeline(policy)
    approach(boat, 6.5, 4)
    policy.failure = PolicyError("no")
    decision = step(boat, 0.5, 6.5)
    assert "policy_error" in names([decision])
    assert decision.thrust.tolist() == [0.0, 0.0]


def test_letting_go_of_the_boat_ends_a_manoeuvre():
    boat = pipeline(Steady((1000.0, 1000.0)))
    approach(boat, 6.5, 5)
    step(boat, 0.5, 6.5, engaged=False)
    decision, _ = boat.step(cloud(0.6), moving(0.6, 0.0), engaged=True)
    assert decision.acted
    assert "assurance_released" not in names([decision])


@pytest.mark.parametrize("enabled", [True, False])
def test_the_configuration_switches_it(enabled):
    config = RuntimeConfig(policy="apf", assurance=AssuranceSettings(enabled=enabled))
    boat = make_pipeline(config)
    assert boat.assurance is not None
    assert boat.assurance.settings.enabled is enabled
    assert boat.assurance.limits == config.thrust

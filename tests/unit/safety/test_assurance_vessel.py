import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from tests.reference.sailing import calm, sail

from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime._native import Law
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.safety.prediction import (
    AssuranceVessel,
    Foresight,
    Motion,
    Thrust,
    slewed,
)
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel_description import load_vessel

PUBLISHED = AssuranceVessel(
    inertia=(380.0, 400.0, 1430.0),
    linear_drag=(100.0, 100.0, 980.0),
    quadratic_drag=(150.0, 150.0, 950.0),
    lever_m=1.25,
)


def foresight(vessel: AssuranceVessel, steps: int, dt: float, slew_nps: float = 1000.0):
    return Foresight(
        vessel, steps=steps, dt=dt, slew_nps=slew_nps, margin_m=0.5, approach_per_s=1.0
    )


def path(vessel: AssuranceVessel, motion: Motion, thrust: Thrust, steps: int, dt: float):
    return foresight(vessel, steps, dt).path(motion, thrust, Law(thrust))


def trained(motion: Motion, thrust: Thrust, seconds: float) -> np.ndarray:
    """Where the training model says the vessel is."""
    model, pose, nu = VesselModel(VesselParameters()), np.zeros(3), np.array(motion)
    for _ in range(round(seconds / 0.0005)):
        pose, nu = model.step(pose, nu, np.array(thrust), 0.0005)
    return pose


@pytest.mark.parametrize("thrust", [(1000.0, 1000.0), (-500.0, 200.0)])
@pytest.mark.parametrize("motion", [Motion(0.0, 0.0, 0.0), Motion(2.5, -0.4, 0.6)])
def test_the_published_vessel_sails_as_the_training_model_does(thrust, motion):
    expected = trained(motion, thrust, 2.0)
    coarse = path(PUBLISHED, motion, thrust, 20, 0.1)[-1] - expected
    fine = path(PUBLISHED, motion, thrust, 200, 0.01)[-1] - expected
    assert np.abs(coarse).max() < 0.2
    assert np.abs(fine).max() < 0.02


def simulated(thrust: Thrust, surge: float, seconds: float) -> VesselState:
    dynamics = VesselDynamics(load_vessel())
    state = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    ready = VesselState(
        position_N=state.position_N,
        q_NB=state.q_NB,
        velocity_B=np.array([[surge, 0.0, 0.0]]),
        rates_B=state.rates_B,
        thrust=state.thrust,
    )
    return sail(dynamics, ready, thrust, calm(), seconds)[-1]


@pytest.mark.parametrize(
    "thrust", [(1000.0, 1000.0), (-500.0, -500.0), (1000.0, -500.0), (200.0, 600.0)]
)
def test_three_seconds_ahead_it_is_within_30_cm_of_the_simulators_vessel(thrust):
    truth = simulated(thrust, 3.0, 3.0)
    there = path(AssuranceVessel(), Motion(3.0, 0.0, 0.0), thrust, 30, 0.1)[-1]
    assert np.hypot(*(there[:2] - truth.position_N[0, :2])) < 0.3


def test_thrust_changes_no_faster_than_the_propellers_may():
    assert slewed((100.0, -200.0), (1000.0, -210.0), 50.0) == (150.0, -210.0)
    assert slewed((100.0, -200.0), (-500.0, 500.0), 50.0) == (50.0, -150.0)


def test_a_slower_propeller_takes_longer_to_stop_the_vessel():
    def stopping_way(slew_nps: float) -> float:
        motion, astern = Motion(3.0, 0.0, 0.0), Law((-500.0, -500.0))
        vessel, start = AssuranceVessel(), (1000.0, 1000.0)
        there = foresight(vessel, 40, 0.1, slew_nps).path(motion, start, astern)
        return float(there[:, 0].max())

    assert stopping_way(500.0) > stopping_way(1000.0) + 0.5 > stopping_way(1e9) + 1.0


def test_the_top_speed_is_where_thrust_and_drag_balance():
    top = AssuranceVessel().top_speed_mps(1000.0)
    assert top == pytest.approx(3.333, abs=1e-3)
    assert (100.0 + 150.0 * top) * top == pytest.approx(2000.0)
    without = AssuranceVessel(quadratic_drag=(0.0, 0.0, 0.0))
    assert without.top_speed_mps(1000.0) == pytest.approx(20.0)


def test_the_extent_reaches_the_farthest_circles_edge():
    assert AssuranceVessel().extent_m == 2.8
    assert AssuranceVessel(hull=((-1.7, 1.3), (1.5, 1.4))).extent_m == pytest.approx(3.0)


@pytest.mark.parametrize(
    "wrong", [{"inertia": [0.0, 1.0, 1.0]}, {"hull": []}, {"hull": [[0.0, -1.0]]}, {"lever_m": 0}]
)
def test_a_vessel_that_cannot_be_is_refused(wrong):
    with pytest.raises(ConfigError):
        convert(wrong, AssuranceVessel)


def test_the_documents_example_is_the_published_vessel():
    text = (Path(__file__).parents[3] / "docs" / "assurance.md").read_text()
    (example,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert convert(tomllib.loads(example), RuntimeConfig).assurance.vessel == PUBLISHED

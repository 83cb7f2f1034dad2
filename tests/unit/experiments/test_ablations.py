import numpy as np
import pytest

from twinscrew.hil_sim.experiments.plan import (
    ABLATIONS,
    calmed,
    dynamics,
    eased,
    label,
    parse_ablations,
    supervision,
    unassured,
    variants,
    vessel_of,
)
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings
from twinscrew.hil_sim.vessel.dynamics import DynamicsSettings, VesselDynamics, as_vrx
from twinscrew.hil_sim.vessel.rest import at_rest, still_water
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel_description import load_vessel


def test_switches_are_read_with_commas_and_each_counts_once() -> None:
    assert parse_ablations(" no_wind,no_waves, no_wind ") == ("no_wind", "no_waves")
    assert parse_ablations("") == ()


def test_an_unknown_switch_names_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"--ablate: 'no_sea' is not one of .*'no_waves'"):
        parse_ablations("no_wind,no_sea")


def test_every_switch_is_sailed_alone_and_all_together_beside_the_full_simulator() -> None:
    assert variants(()) == ((),)
    assert variants(("no_wind",)) == ((), ("no_wind",))
    two = ("no_wind", "no_waves")
    assert variants(two) == ((), ("no_wind",), ("no_waves",), two)
    assert [label(one) for one in variants(two)][::3] == ["full", "no_wind+no_waves"]


def test_a_base_holds_in_every_variant_and_is_not_switched_off_twice() -> None:
    base = ("no_assurance",)
    assert variants((), base) == (base,)
    sailed = variants(("no_wind", "no_assurance", "no_waves"), base)
    assert sailed == (base, (*base, "no_wind"), (*base, "no_waves"), (*base, "no_wind", "no_waves"))


def test_gap_stands_for_all_that_training_does_not_have() -> None:
    switches = parse_ablations("gap")
    assert {"ideal_tracking", "no_waves", "training_vessel", "vanish"} < set(switches)
    assert set(switches) == set(ABLATIONS) - {"goal_4m", "as_vrx", "no_chart"}
    assert parse_ablations("no_wind,gap").count("no_wind") == 1


@pytest.mark.parametrize(("switch", "wind", "wave"), [("no_wind", 0, 1), ("no_waves", 1, 0)])
def test_wind_and_waves_go_one_by_one(switch: str, wind: bool, wave: bool) -> None:
    sea = Sea(calmed(SeaSettings(), (switch,)), np.random.default_rng(1))
    heights = [float(sea.elevation(np.array([3.0, 4.0]), time_s)) for time_s in (20, 21, 22)]
    assert bool(np.hypot(*sea.wind(5.0)) > 0) is bool(wind)
    assert bool(np.ptp(heights) > 0) is bool(wave)


def test_other_switches_leave_the_sea_alone() -> None:
    others = tuple(name for name in ABLATIONS if name not in {"no_wind", "no_waves"})
    assert calmed(SeaSettings(), others) == SeaSettings()


def test_goals_and_arrivals_are_as_the_switches_say() -> None:
    scenario = load_scenario("head_on")
    assert eased(scenario, ()).goal_radius == 2.0
    assert eased(scenario, ("goal_4m",)).goal_radius == 4.0
    assert unassured(()) == {}
    assert unassured(("no_assurance",)) == {"enabled": False}
    assert supervision(()).after_goal == "hold"
    assert supervision(("vanish",)).after_goal == "vanish"


def test_physics_are_ours_or_vrxs() -> None:
    assert dynamics(()) == DynamicsSettings()
    assert dynamics(("no_wind", "as_vrx")) == as_vrx()
    assert as_vrx() != DynamicsSettings()


def test_the_training_vessel_is_as_fast_ahead_as_trainings_and_floats_level() -> None:
    dynamics = VesselDynamics(vessel_of(("training_vessel",), load_vessel()))
    water, dt = still_water(), 0.01
    state = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    assert abs(2.0 * state.q_NB[0, 2]) < np.radians(1.0)
    for k in range(4000):
        state = dynamics.step(state, np.full((1, 2), 1000.0), water, k * dt, dt)
    # 2000 N = 100 u + 150 u^2, by the quadratic formula.
    steady = (-100 + np.sqrt(100**2 + 4 * 150 * 2000)) / 300
    assert state.velocity_B[0, 0] == pytest.approx(steady, rel=0.01)


def test_the_training_vessel_turns_on_the_spot_as_fast_as_trainings() -> None:
    dynamics = VesselDynamics(vessel_of(("training_vessel",), load_vessel()))
    water, dt = still_water(), 0.01
    state = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    for k in range(3000):
        state = dynamics.step(state, np.array([[500.0, -500.0]]), water, k * dt, dt)
    # 1000 N x 1.25 m = 980 r + 950 r^2
    steady = (-980 + np.sqrt(980**2 + 4 * 950 * 1250)) / 1900
    assert state.rates_B[0, 2] == pytest.approx(steady, rel=0.03)

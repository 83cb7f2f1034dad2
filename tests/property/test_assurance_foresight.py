"""The native prediction and judgement against the plain ones."""

from functools import partial

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from tests.reference.assurance import predict, worst_contact

from twinscrew.runtime._native import Law
from twinscrew.runtime.safety.assurance import braking, manoeuvres
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.safety.prediction import STILL, AssuranceVessel, Circles, Foresight, Motion

STEPS, DT, SLEW, MARGIN, APPROACH = 40, 0.1, 1000.0, 0.8, 0.7
LIMITS = ThrustLimits()
HULLS = (((0.0, 2.8),), ((-1.7, 1.3), (1.5, 1.4)), ((0.0, 0.4), (2.0, 0.3), (-2.0, 0.3)))

thrusts = st.tuples(*2 * [st.floats(-500.0, 1000.0)])
motions = st.builds(Motion, st.floats(-2.0, 4.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
pushes = st.tuples(*2 * [st.floats(-300.0, 300.0)])
vessels = st.builds(lambda hull: AssuranceVessel(hull=hull), st.sampled_from(HULLS))


def way_out(index: int) -> Law:
    ways = manoeuvres(LIMITS, brake_nspm=500.0, turn_n=500.0, to_starboard=True)
    return ways[index].law


# Recipes, not laws: strategies and examples live until the interpreter ends, and a native object
# that lives as long is reported as leaked.
ways_out = st.builds(partial, st.just(way_out), st.integers(0, 4))
recipes = st.one_of(
    st.builds(partial, st.just(Law), thrusts),
    ways_out,
    st.builds(lambda turn: partial(braking, 500.0, turn, LIMITS), st.floats(-500.0, 500.0)),
    st.builds(
        lambda wait_s, command, recipe: lambda: recipe().after(command, wait_s),
        st.floats(0.0, 1.0),
        thrusts,
        ways_out,
    ),
)


def foresight(vessel: AssuranceVessel) -> Foresight:
    return Foresight(
        vessel,
        steps=STEPS,
        dt=DT,
        slew_nps=SLEW,
        margin_m=MARGIN,
        approach_per_s=APPROACH,
    )


def circles(seed: int, count: int) -> Circles:
    rng = np.random.default_rng(seed)
    moving = rng.random((count, 1)) < 0.5
    return Circles(
        id=tuple(range(100, 100 + count)),
        p_L=rng.uniform(-14.0, 14.0, (count, 2)),
        v_L=rng.uniform(-3.0, 3.0, (count, 2)) * moving,
        radius=rng.uniform(0.5, 3.0, count),
        horizon_s=np.where(moving[:, 0], 1.5, 4.0),
    )


@given(vessels, motions, thrusts, recipes, pushes)
def test_the_path_is_the_plain_ones(vessel, motion, thrust, recipe, push):
    law = recipe()
    expected = predict(vessel, motion, thrust, law, steps=STEPS, dt=DT, slew_nps=SLEW, push=push)
    assert foresight(vessel).path(motion, thrust, law, push) == pytest.approx(expected, abs=1e-12)


@given(vessels, motions, thrusts, recipes, pushes, st.integers(0, 1 << 20), st.integers(1, 12))
@example(
    AssuranceVessel(), Motion(3.0, 0.0, 0.0), (1e3, 1e3), partial(Law, (1e3, 1e3)), STILL, 3, 12
)
def test_the_contact_is_the_plain_ones(vessel, motion, thrust, recipe, push, seed, count):
    law = recipe()
    around = circles(seed, count)
    path = predict(vessel, motion, thrust, law, steps=STEPS, dt=DT, slew_nps=SLEW, push=push)
    expected = worst_contact(
        path, around, vessel.hull, dt=DT, margin_m=MARGIN, approach_per_s=APPROACH
    )
    for found in (
        foresight(vessel).contact(path, around),
        foresight(vessel).judge(motion, thrust, law, around, push),
    ):
        assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("wrong", ["p_L", "v_L", "horizon_s"])
def test_arrays_that_disagree_are_refused(wrong):
    from dataclasses import replace

    around = circles(0, 4)
    short = replace(around, **{wrong: getattr(around, wrong)[:-1].copy()})
    judge = foresight(AssuranceVessel()).judge
    with pytest.raises(ValueError, match="of every circle"):
        judge(Motion(0.0, 0.0, 0.0), (0.0, 0.0), Law((0.0, 0.0)), short)

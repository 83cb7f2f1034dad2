"""Any hull among vessels that give no way: what is drawn, seen and touched."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.policy.hull_units import HULL_COLUMNS, describe_hull
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.training.environment import EnvironmentSettings, VectorEnv, steer_at_goal
from twinscrew.training.networks import Scales, outlined_features, unpack
from twinscrew.training.perception import NoiseSettings, layout_of
from twinscrew.training.physics import (
    CHANCES,
    HULL_CHANCES,
    ConditionSettings,
    HullSettings,
    UnknownSettings,
    draw_hulls,
    rectangle_gap,
)
from twinscrew.training.scenarios import ScenarioSettings, StrangerSettings

ROW = ScenarioSettings(robots=3, min_distance_m=30.0, strangers=5)
ANY = ConditionSettings(hulls=HullSettings(share=1.0), current_mps=(0.2, 0.9))
SETTINGS = EnvironmentSettings(scenarios=(ROW,), conditions=ANY, observed_objects=8, extended=True)


def sailed(env, steps):
    seen = env.reset()
    for _ in range(steps):
        seen = env.step(steer_at_goal(seen.ego)).observation
    return seen


def test_a_slots_episodes_are_its_own_in_any_batch():
    many, one = VectorEnv(SETTINGS, 6, 3), VectorEnv(SETTINGS, 1, 3, first_slot=4)
    assert np.array_equal(sailed(many, 30).rows[4], sailed(one, 30).rows[0])


def test_what_a_policy_is_told_of_its_hull_is_how_it_moves():
    """Top speed, acceleration and turning rate by the equations of motion."""
    told = dict(zip(HULL_COLUMNS, describe_hull(VesselParameters()), strict=True))
    model, pose, nu = VesselModel(), np.zeros(3), np.zeros(3)
    full, apart = np.array([1000.0, 1000.0]), np.array([1000.0, -500.0])
    assert model.acceleration(nu, model.force(full))[0] == pytest.approx(told["acceleration"])
    assert model.acceleration(nu, model.force(apart))[2] == pytest.approx(told["turn_acceleration"])
    for _ in range(2000):
        pose, nu = model.step(pose, nu, full, 0.05)
    assert nu[0] == pytest.approx(told["top_speed"], rel=1e-3)
    surge_free = VesselModel(VesselParameters(x_uu=-1e6, y_vv=-1e6))
    for _ in range(2000):
        pose, nu = surge_free.step(pose, nu * [0, 0, 1], apart, 0.05)
    assert nu[2] == pytest.approx(told["turn_rate"], rel=1e-2)


@pytest.mark.parametrize(
    ("what", "column", "factors"),
    [
        ({"mass": 0.25}, "acceleration", (1 / 1.25, 1 / 0.75)),
        ({"drag": 0.5}, "top_speed", (1 / 1.5, 1 / 0.5)),
        ({"propeller": 0.3}, "thrust_min", (0.7, 1.0)),
        ({"lag_s": 0.5}, "thrust_lag", (0.0, 0.5)),
    ],
)
def test_what_a_policy_is_not_told_changes_its_hull_and_not_what_it_is_told(what, column, factors):
    """A hull's own numbers lie within the range, on both sides of what is told."""
    chance = np.random.default_rng(4).random((50, 4, CHANCES + HULL_CHANCES))
    settings = ConditionSettings(unknown=UnknownSettings(**what))
    drawn = draw_hulls(settings, VesselParameters(), chance)
    assert np.all(drawn.told == describe_hull(VesselParameters()).astype(np.float32))
    p = drawn.physical
    acts = {
        "acceleration": p[0].mean() / p[0],
        "top_speed": p[6].mean() / p[6],
        "thrust_min": drawn.gain.min(axis=0),
        "thrust_lag": drawn.lag,
    }[column]
    assert acts.min() >= 0.95 * factors[0]
    assert acts.max() <= 1.05 * factors[1]
    assert acts.max() > acts.min() or column == "thrust_min"


def test_drawn_hulls_keep_their_told_top_speed_over_the_water():
    """Straight ahead at full thrust, no wind: the hull told the truth sails as it was told."""
    told_true = ConditionSettings(hulls=HullSettings(share=1.0, unknown=0.0, weak=0.0))
    row = ScenarioSettings(robots=1, min_distance_m=30.0)
    settings = EnvironmentSettings(
        scenarios=(row,), conditions=told_true, extended=True, goal_radius_m=0.01
    )
    env = VectorEnv(settings, 40, 1, auto_reset=False)
    seen = env.reset()
    hull = seen.hull[:, 0].copy()
    for _ in range(120):
        result = env.step(np.ones((40, 1, 2)))
        active = result.active[:, 0]
    assert active.sum() > 30
    speed = np.abs(env.state.nu[0][:, 0])
    assert np.allclose(speed[active], hull[active, 1], rtol=0.02)


@given(
    st.floats(-40, 40),
    st.floats(-40, 40),
    st.floats(-3.1, 3.1),
    st.floats(0.3, 15),
    st.floats(0.2, 5),
)
def test_the_gap_to_a_rectangle_is_that_to_its_nearest_point(x, y, heading, a, b):
    """Against a dense sampling of the rectangle; the networks' own arithmetic agrees."""
    grid = np.linspace(-1, 1, 81)
    inside = (a * grid[:, None] + 1j * b * grid).ravel() * np.exp(1j * heading)
    gap = float(rectangle_gap(np.array(complex(x, y)), np.array(heading), np.array([a, b])))
    nearest = float(np.abs(complex(x, y) + inside).min())
    assert gap <= nearest + 1e-9
    assert nearest <= gap + max(a, b) / 40
    row = np.zeros(89, np.float32)
    row[7:12], row[47] = (x, y, 0, 0, 1.0), 1.0
    row[55:58] = a, b, heading
    row[79:] = describe_hull(VesselParameters())
    features = outlined_features(unpack(torch.from_numpy(row)[None]), Scales())
    own = VesselParameters().radius
    assert features[0, 0, 9].item() * 20.0 + own == pytest.approx(gap, abs=2e-3)


def test_outlines_are_seen_where_they_are():
    """Without noise, a shown rectangle is the stranger's own, in the observer's frame."""
    quiet = EnvironmentSettings(
        scenarios=(ROW,),
        noise=NoiseSettings(perfect=True),
        observed_objects=8,
        extended=True,
        strangers=StrangerSettings(outlined=1.0),
    )
    env = VectorEnv(quiet, 20, 5)
    seen, state, found = sailed(env, 6), env.state, 0
    for e, v, k in np.argwhere(seen.outlines[..., 0] > 0):
        x, y = seen.objects[e, v, k, :2]
        at = state.position[e, v] + complex(x, y) * np.exp(1j * state.heading[e, v])
        t = np.abs(state.scripted[e] - at).argmin()
        assert abs(state.scripted[e, t] - at) < 1e-3
        a, b, heading = seen.outlines[e, v, k]
        assert (a, b) == pytest.approx(state.scripted_half[e, t], rel=1e-5)
        difference = heading + state.heading[e, v] - state.scripted_heading[e, t]
        assert np.exp(1j * difference) == pytest.approx(1.0, abs=1e-4)
        found += 1
    assert found > 20


def test_a_stranger_that_is_met_is_touched_and_one_passed_is_not():
    """A rectangle laid across the way; then the same one, a length to the side."""
    row = ScenarioSettings(robots=1, min_distance_m=30.0, strangers=1)
    for aside, touches in ((0.0, True), (12.0, False)):
        env = VectorEnv(EnvironmentSettings(scenarios=(row,)), 8, 2, auto_reset=False)
        seen, state = env.reset(), env.state
        way = state.goal - state.position
        ahead = way / np.abs(way)
        state.heading[:] = np.angle(way)
        state.scripted[:] = state.position + way / 2 + 1j * ahead * aside
        state.scripted_velocity[:] = 0.0
        state.scripted_turn[:] = 0.0
        state.scripted_half[:] = [1.0, 4.0]
        state.scripted_heading[:] = np.angle(way)
        state.scripted_radius[:] = np.hypot(1.0, 4.0)
        hit = np.zeros(8, bool)
        for _ in range(80):
            result = env.step(steer_at_goal(seen.ego))
            hit |= result.touched_vessel[:, 0]
            seen = result.observation
        assert hit.all() == touches
        assert hit.any() == touches


def test_strangers_begin_clear_of_everyone_and_meet_someone():
    """Each begins far enough for two seconds and a half; nearly all come near if nobody alters."""
    env = VectorEnv(SETTINGS, 200, 9)
    env.reset()
    state = env.state
    there = state.scripted_radius > 0
    gaps = (
        np.abs(state.scripted[:, None] - state.position[..., None]) - state.scripted_radius[:, None]
    )
    gaps = np.where(state.active[..., None] & there[:, None], gaps, np.inf)
    assert gaps.min() >= 9.0
    moving = there & (np.abs(state.scripted_velocity) > 0.2)
    assert 0.4 < moving[:, 0].mean() < 0.95
    assert there[:, 0].mean() > 0.9


def test_the_current_carries_who_is_under_way_and_speeds_are_over_ground():
    drift = ConditionSettings(hulls=HullSettings(), current_mps=(0.5, 0.5))
    row = ScenarioSettings(robots=2, min_distance_m=30.0)
    env = VectorEnv(EnvironmentSettings(scenarios=(row,), conditions=drift, extended=True), 5, 0)
    env.reset()
    before = env.state.position.copy()
    result = env.step(np.zeros((5, 2, 2)))
    moved = env.state.position - before
    assert np.allclose(np.abs(moved), 0.25)
    ego = result.observation.ego
    assert np.allclose(np.hypot(ego[..., 2], ego[..., 3]), 0.5, atol=1e-5)


def test_a_row_s_layout_follows_from_its_width():
    for objects in range(1, 20):
        for extended in (False, True):
            layout = layout_of(17 + 9 * objects if extended else 7 + 6 * objects)
            assert layout == (objects, extended, False)
        assert layout_of(50 + 9 * objects) == (objects, True, True)

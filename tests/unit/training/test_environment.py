"""The batched environment against the scalar reference, and its promises about randomness."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from tests.reference import environment as reference

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.training.environment import (
    EnvironmentSettings,
    RewardSettings,
    StepResult,
    VectorEnv,
)
from twinscrew.training.perception import NoiseSettings, Observations
from twinscrew.training.physics import ConditionSettings
from twinscrew.training.scenarios import MapSettings, ScenarioSettings, six_settings

SIX = EnvironmentSettings(scenarios=six_settings())


class Seen(NamedTuple):
    """The noise of one decision, (E, V, O) each."""

    position: np.ndarray
    velocity: np.ndarray
    radius: np.ndarray


def scatter(env: VectorEnv, generator: np.random.Generator) -> None:
    """Bring the vessels close together, under way in all directions."""
    shape = env.state.heading.shape
    env.state.north_east[:] = generator.uniform(8.0, 47.0, (2, *shape))
    env.state.position[:] = env.state.north_east[0] + 1j * env.state.north_east[1]
    env.state.heading[:] = generator.uniform(-np.pi, np.pi, shape)
    env.state.nu[:] = generator.uniform(-1, 3, (3, *shape)) * np.array([1, 0.3, 0.3])[:, None, None]
    env.state.thrust[:] = generator.uniform(-500, 1000, (2, *shape))
    env.state.nu *= env.state.active
    env.state.thrust *= env.state.active
    near = generator.random(shape) < 0.2
    env.state.goal[near] = env.state.position[near] + 1.5
    left = env.state.active & (generator.random(shape) < 0.1)
    left[:, 0] = False
    env.state.active &= ~left
    env.state.nu *= env.state.active
    env.state.thrust *= env.state.active


def test_one_decision_equals_the_scalar_reference_in_every_quantity() -> None:
    generator = np.random.default_rng(5)
    env = VectorEnv(SIX, episodes=24, seed=11)
    env.reset()
    scatter(env, generator)
    before = [
        [
            reference.Vessel(
                *env.state.north_east[:, e, v],
                env.state.heading[e, v],
                *env.state.nu[:, e, v],
                *env.state.thrust[:, e, v],
                env.state.goal[e, v].real,
                env.state.goal[e, v].imag,
                bool(env.state.active[e, v]),
            )
            for v in range(env.vessels)
        ]
        for e in range(env.episodes)
    ]
    buoys = [list(env.state.buoy[e][env.state.buoy_there[e]]) for e in range(env.episodes)]
    noise = Seen(*env.perception.noise.values(env.perception.noise.next()))
    env.perception.noise._left += 1  # what the step is going to draw
    action = generator.uniform(-1.3, 1.3, (env.episodes, env.vessels, 2))
    result = env.step(action)
    seen_situations = touched = arrived = 0
    for e, vessels in enumerate(before):
        acting = [b.there for b in vessels]
        gaps = [b.to_goal for b in vessels]
        by_vessel, by_buoy = reference.decide(vessels, buoys[e], action[e].tolist())
        collided = [a or b for a, b in zip(by_vessel, by_buoy, strict=True)]
        reached = [
            a and not c and b.to_goal <= 2.0
            for a, b, c in zip(acting, vessels, collided, strict=True)
        ]
        for b, hit, home in zip(vessels, collided, reached, strict=True):
            b.there = b.there and not hit and not home
        assert result.active[e].tolist() == acting
        assert result.touched_vessel[e].tolist() == by_vessel
        assert result.touched_buoy[e].tolist() == by_buoy
        assert result.reached[e].tolist() == reached
        for k in np.flatnonzero(acting):
            b = vessels[k]
            wave = [
                (complex(noise.position[e, k, o]), complex(noise.velocity[e, k, o]), f)
                for o, f in enumerate(noise.radius[e, k].tolist())
            ]
            there = wave[: env.vessels] + wave[env.vessels :][: len(buoys[e])]
            objects = reference.perceive(k, vessels, buoys[e], there)
            count = int(result.final_observation.mask[e, k].sum())
            assert count == len(objects)
            got = result.final_observation.objects[e, k, :count]
            np.testing.assert_allclose(got, np.reshape(objects, (count, 5)), atol=2e-5)
            delta = reference.colregs_delta(b, objects)
            expected = -0.1 + gaps[k] - b.to_goal - 0.1 * delta
            expected += -5.0 * collided[k] + 10.0 * reached[k]
            assert result.reward[e, k] == pytest.approx(expected, abs=2e-5)
            seen_situations += delta > 0
            touched += collided[k]
            arrived += reached[k]
            goal = (complex(b.goal_x, b.goal_y) - complex(b.x, b.y)) * np.exp(-1j * b.psi)
            ego = [goal.real, goal.imag, b.u, b.v, b.r, b.left, b.right]
            np.testing.assert_allclose(result.final_observation.ego[e, k], ego, atol=1e-4)
    assert min(seen_situations, touched, arrived) > 0  # the case is rich enough to mean something


def sailed(env: VectorEnv, decisions: int) -> list[StepResult]:
    """Sail with fixed actions that depend on the observation only, per slot."""
    seen = env.reset()
    results = []
    for _ in range(decisions):
        action = np.stack([np.sin(seen.ego[..., 0]), np.cos(seen.ego[..., 1])], axis=-1)
        results.append(env.step(action))
        seen = results[-1].observation
    return results


def test_a_slot_sails_the_same_alone_and_among_others_through_many_episodes() -> None:
    settings = EnvironmentSettings(scenarios=six_settings(), decision_limit=12)
    many = sailed(VectorEnv(settings, 7, seed=3), 80)
    alone = sailed(VectorEnv(settings, 1, seed=3, first_slot=4), 80)
    assert sum(int(r.finished[4]) for r in many) > 5
    for one, all_ in zip(alone, many, strict=True):
        assert np.array_equal(one.reward[0], all_.reward[4])
        assert np.array_equal(one.observation.objects[0], all_.observation.objects[4])
        assert np.array_equal(one.observation.ego[0], all_.observation.ego[4])


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_episode() -> None:
    first, again, other = (sailed(VectorEnv(SIX, 3, seed), 20) for seed in (1, 1, 2))
    assert first[-1].observation.objects.tobytes() == again[-1].observation.objects.tobytes()
    assert first[0].observation.ego.tobytes() != other[0].observation.ego.tobytes()


def test_two_vessels_of_an_episode_do_not_share_their_noise() -> None:
    noise = VectorEnv(SIX, 2, seed=0).perception.noise
    noise = noise.values(noise.next())[0]
    rows = noise.reshape(-1, noise.shape[-1])
    assert len(np.unique(rows.round(7), axis=0)) == len(rows)


def test_an_episode_at_the_limit_is_truncated_and_not_terminated() -> None:
    env = VectorEnv(EnvironmentSettings(decision_limit=3), 2, seed=0)
    env.reset()
    idle = np.zeros((2, 3, 2))
    for _ in range(2):
        assert not env.step(idle).truncated.any()
    result = env.step(idle)
    assert result.truncated.all()
    assert not result.terminated.any()
    assert result.finished.all()
    assert env.active.all()  # the next episodes have begun
    assert not np.array_equal(result.observation.ego, result.final_observation.ego)


def test_without_auto_reset_a_finished_slot_stays_empty() -> None:
    env = VectorEnv(EnvironmentSettings(decision_limit=1), 1, seed=0, auto_reset=False)
    env.reset()
    env.step(np.ones((1, 3, 2)))
    result = env.step(np.ones((1, 3, 2)))
    assert not result.active.any()
    assert not result.reward.any()
    assert not result.observation.mask.any()


def put(env: VectorEnv, vessel: int, place: complex, heading: float, surge: float) -> None:
    env.state.position[0, vessel] = place
    env.state.north_east[:, 0, vessel] = place.real, place.imag
    env.state.heading[0, vessel] = heading
    env.state.nu[:, 0, vessel] = surge, 0.0, 0.0


def test_two_vessels_that_touch_between_decisions_only_have_collided() -> None:
    """Glancing past each other: apart at both decisions, touching in the middle."""
    env = VectorEnv(EnvironmentSettings(scenarios=(ScenarioSettings(robots=2),)), 1, seed=0)
    env.reset()
    gap = 2 * reference.RADIUS - 0.02
    put(env, 0, 20 + 20j, 0.0, 3.0)
    put(env, 1, 21.48 + (20 + gap) * 1j, np.pi, 3.0)
    env.state.thrust[:] = 750.0
    result = env.step(np.zeros((1, 2, 2)))
    ends = env.physics.motion.trajectory[[0, -1]].reshape(2, 2, 2)
    apart = np.hypot(*(ends[:, :, 0] - ends[:, :, 1]).T)
    assert (apart > 2 * reference.RADIUS).all()
    assert result.touched_vessel.all()
    assert result.terminated.all()


@pytest.mark.parametrize("park", [True, False])
def test_a_parked_vessel_can_be_hit_and_a_vanished_one_cannot(park: bool) -> None:
    settings = EnvironmentSettings(scenarios=(ScenarioSettings(robots=2),), park=park)
    env = VectorEnv(settings, 1, seed=0, auto_reset=False)
    env.reset()
    put(env, 0, 20 + 20j, 0.0, 0.0)
    env.state.goal[0, 0] = 20 + 20j
    put(env, 1, 20 + 26.5j, -np.pi / 2, 0.0)
    env.state.goal[0, 1] = 50 + 50j
    first = env.step(np.zeros((1, 2, 2)))
    assert first.reached.tolist() == [[True, False]]
    env.state.nu[0, 0, 1] = 3.0
    second = env.step(np.ones((1, 2, 2)))
    assert second.active.tolist() == [[False, True]]
    assert second.touched_vessel[0, 1] == park
    assert not second.terminated[0, 0]
    assert env.state.position[0, 0] == 20 + 20j  # where it arrived


def test_wind_pushes_a_drifting_vessel_where_it_blows_to() -> None:
    settings = EnvironmentSettings(conditions=ConditionSettings(wind_mps=(10.0, 10.0)))
    env = VectorEnv(settings, 4, seed=0)
    env.reset()
    start, there = env.state.position.copy(), env.state.active.copy()
    for _ in range(6):
        env.step(np.zeros((4, 3, 2)))
    drift = env.state.position - start
    blow = np.broadcast_to(env.physics.forces.wind, drift.shape)
    along = (drift * blow.conj()).real / np.abs(blow)
    assert (along[there & env.state.active] > 0.1).all()


def test_without_wind_and_thrust_nothing_moves() -> None:
    env = VectorEnv(EnvironmentSettings(), 4, seed=0)
    env.reset()
    start = env.state.position.copy()
    env.step(np.zeros((4, 3, 2)))
    assert np.array_equal(env.state.position, start)


def test_thrust_lags_behind_its_command_as_a_first_order_filter() -> None:
    settings = EnvironmentSettings(conditions=ConditionSettings(thrust_lag_s=0.4))
    env = VectorEnv(settings, 1, seed=0)
    env.reset()
    result = env.step(np.ones((1, 3, 2)))
    assert np.all(result.observation.ego[..., 5:7] == 500.0)  # the observation has the command
    np.testing.assert_allclose(env.physics.forces.thrust, 500.0 * (1 - np.exp(-0.5 / 0.4)))


def test_the_weights_decide_which_row_new_episodes_follow() -> None:
    env = VectorEnv(SIX, 16, seed=0)
    env.reset()
    env.set_weights([0, 0, 0, 0, 0, 1])
    env.reset()
    assert env.active.all()
    assert env.state.buoy_there.all()
    env.set_weights([1, 0, 0, 0, 0, 0])
    env.reset()
    assert (env.active.sum(axis=1) == 3).all()


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        (EnvironmentSettings(scenarios=(ScenarioSettings(robots=60),)), "robots"),
        (EnvironmentSettings(scenarios=(ScenarioSettings(min_distance_m=80.0),)), "72.1"),
        (EnvironmentSettings(scenarios=()), "scenario"),
        (EnvironmentSettings(period_s=0.52), "substep_s"),
        (EnvironmentSettings(map=MapSettings(size_m=3.0)), "size_m"),
        (EnvironmentSettings(conditions=ConditionSettings(wind_mps=(5.0, 1.0))), "wind_mps"),
    ],
)
def test_what_cannot_be_is_refused_in_words(settings: EnvironmentSettings, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        VectorEnv(settings, 1, 0)


def test_what_only_sampling_shows_to_be_impossible_is_refused_too() -> None:
    settings = EnvironmentSettings(scenarios=(ScenarioSettings(robots=38, min_distance_m=40.0),))
    with pytest.raises(ConfigError, match="do not fit"):
        VectorEnv(settings, 1, 0).reset()


def test_perfect_perception_shows_the_true_radius_and_the_first_rule_differs() -> None:
    settings = EnvironmentSettings(
        noise=NoiseSettings(perfect=True), reward=RewardSettings(which="first")
    )
    env = VectorEnv(settings, 8, seed=0)
    seen = env.reset()
    radii = seen.objects[..., 4][seen.mask > 0]
    assert radii.size
    assert np.all(radii == np.float32(reference.RADIUS))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_action_that_is_not_finite_is_refused_unless_nobody_takes_it(bad: float) -> None:
    env = VectorEnv(EnvironmentSettings(), 2, seed=0)
    env.reset()
    action = np.zeros((2, 3, 2))
    action[1, 2, 0] = bad
    with pytest.raises(PolicyError, match="vessel 2 in episode 1"):
        env.step(action)
    env.state.active[1, 2] = False
    assert np.isfinite(env.step(action).observation.rows).all()


def test_an_observations_parts_are_views_of_its_row() -> None:
    seen = Observations.empty((2, 3))
    seen.objects[1, 2, 4, 3] = 7.0
    seen.mask[1, 2, 4] = 1.0
    assert seen.rows[1, 2, 7 + 4 * 5 + 3] == 7.0
    assert seen.rows[1, 2, -1] == 1.0
    assert all(part.base is not None for part in seen)

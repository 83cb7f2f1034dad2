"""What holds in every episode, whatever the vessels do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.training import physics as contacts
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.imperfections import ImperfectionSettings
from twinscrew.training.physics import ConditionSettings
from twinscrew.training.scenarios import six_settings

CALM = ConditionSettings()
ROUGH = ConditionSettings(
    wind_mps=(0.0, 15.0), gust=0.5, wave_force_n=(0.0, 200.0), thrust_lag_s=0.3
)
PERFECT = ImperfectionSettings()
POOR = ImperfectionSettings(
    velocity_lag_s=0.5,
    drift_position_m=0.2,
    lost_rate_hz=0.3,
    merge_gap_m=1.0,
    split_probability=0.2,
)


@pytest.mark.slow
@settings(max_examples=examples(25), deadline=None)
@given(
    seed=st.integers(0, 2**32),
    conditions=st.sampled_from([CALM, ROUGH]),
    imperfections=st.sampled_from([PERFECT, POOR]),
    park=st.booleans(),
    bias=st.floats(-1.0, 1.0),
)
def test_observations_and_rewards_stay_sound(
    seed: int,
    conditions: ConditionSettings,
    imperfections: ImperfectionSettings,
    park: bool,
    bias: float,
) -> None:
    env = VectorEnv(
        EnvironmentSettings(
            scenarios=six_settings(),
            conditions=conditions,
            imperfections=imperfections,
            park=park,
            decision_limit=25,
        ),
        episodes=3,
        seed=seed,
    )
    env.reset()
    generator = np.random.default_rng(seed)
    active = env.active
    for _ in range(40):
        result = env.step(bias + generator.uniform(-1, 1, (3, env.vessels, 2)))
        assert np.array_equal(result.active, active)
        active = env.active
        seen = result.observation
        for part in (*seen, *result.final_observation, result.reward):
            assert part.dtype == np.float32
            assert np.isfinite(part).all()
        assert not result.reward[~result.active].any()
        assert not (result.terminated & result.truncated).any()
        assert not (result.terminated & ~result.active).any()
        assert np.array_equal(result.terminated, result.reached | result.collided)
        assert (np.diff(seen.mask, axis=-1) <= 0).all()  # objects first, padding after
        assert not seen.objects[seen.mask == 0].any()
        assert not seen.ego[~active].any()
        surface = np.hypot(seen.objects[..., 0], seen.objects[..., 1]) - seen.objects[..., 4]
        ordered = np.diff(surface, axis=-1)[seen.mask[..., 1:] > 0]
        assert (ordered >= -1e-4).all()  # nearest first
        assert (seen.ego[..., 5:7] >= -500).all()
        assert (seen.ego[..., 5:7] <= 1000).all()
        assert (np.abs(env.state.heading) < 100).all()


@settings(max_examples=examples(60), deadline=None)
@given(seed=st.integers(0, 2**32), spread=st.floats(4.0, 40.0), speed=st.floats(0.0, 20.0))
def test_the_broad_phase_never_misses_a_contact(seed: int, spread: float, speed: float) -> None:
    generator = np.random.default_rng(seed)
    start = generator.uniform(0, spread, (1, 2, 4, 5))
    steps = generator.normal(0, speed * 0.05 + 1e-9, (10, 2, 4, 5))
    trajectory = np.concatenate([start, start + np.cumsum(steps, axis=0)])
    there = generator.random((4, 5)) < 0.8
    buoy = generator.uniform(0, spread, (4, 3)) * (1 + 1j)
    buoy_there = generator.random((4, 3)) < 0.7
    radius = np.full((4, 5), 2.8)
    strayed = contacts.strayed(trajectory.reshape(11, 2, -1)).reshape(4, 5)
    place = trajectory[1:, 0] + 1j * trajectory[1:, 1]
    both = there[:, :, None] & there[:, None, :] & ~np.eye(5, dtype=bool)
    near = np.abs(place[..., :, None] - place[..., None, :]) < 2 * 2.8
    expected = (near.any(axis=0) & both).any(axis=-1)
    assert np.array_equal(contacts.between_vessels(trajectory, strayed, there, radius), expected)
    near = np.abs(place[..., :, None] - buoy[:, None, :]) < 2.8 + 1.0
    expected = (near.any(axis=0) & there[:, :, None] & buoy_there[:, None, :]).any(axis=-1)
    found = contacts.with_buoys(trajectory, strayed, there, radius, buoy, buoy_there, 1.0)
    assert np.array_equal(found, expected)

"""The PettingZoo face."""

from __future__ import annotations

import numpy as np
from pettingzoo.test import parallel_api_test, parallel_seed_test

from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.parallel_env import VesselsEnv
from twinscrew.training.settings_table import six_settings

CROWDED = EnvironmentSettings(scenarios=six_settings()[-1:], decision_limit=60)


def test_it_passes_pettingzoos_own_checks() -> None:
    parallel_api_test(VesselsEnv(CROWDED), num_cycles=200)
    parallel_seed_test(lambda: VesselsEnv(CROWDED), num_cycles=20)


def test_an_agent_sees_and_earns_what_its_vessel_does_in_the_batch() -> None:
    env, batch = VesselsEnv(CROWDED), VectorEnv(CROWDED, 1, seed=5)
    seen, _ = env.reset(seed=5)
    batch.reset()
    actions = {agent: np.full(2, 0.2 * k, np.float32) for k, agent in enumerate(env.agents)}
    assert set(seen) == set(actions)
    seen, rewards, *_ = env.step(actions)
    result = batch.step(np.stack(list(actions.values()))[None])
    for k, agent in enumerate(actions):
        assert rewards[agent] == result.reward[0, k]
        assert np.array_equal(seen[agent]["objects"], result.final_observation.objects[0, k])


def test_agents_leave_until_none_is_left_and_one_step_reports_each_end() -> None:
    env = VesselsEnv(CROWDED)
    env.reset(seed=1)
    ended: list[str] = []
    while env.agents:
        acting = list(env.agents)
        _, _, terminated, truncated, infos = env.step({a: np.ones(2, np.float32) for a in acting})
        assert set(terminated) == set(acting)
        gone = [a for a in acting if terminated[a] or truncated[a]]
        assert set(env.agents) == set(acting) - set(gone)
        for agent in gone:
            info = infos[agent]
            why = info["reached"] or info["touched_vessel"] or info["touched_buoy"]
            assert why == terminated[agent]
        ended += gone
    assert sorted(ended) == env.possible_agents

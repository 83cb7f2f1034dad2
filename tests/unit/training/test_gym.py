"""The environment in Gymnasium's and PettingZoo's terms, and by itself."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium
import matplotlib as mpl
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test, render_test
from pettingzoo.utils import parallel_to_aec

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.gym import VesselsEnv, VesselVectorEnv, flat_scale
from twinscrew.training.scenarios import six_settings

CROWDED = EnvironmentSettings(scenarios=six_settings()[-1:], decision_limit=60)
EXAMPLE = Path(__file__).parents[3] / "examples" / "sb3_ppo.py"


@pytest.fixture(autouse=True)
def _no_screen() -> None:
    mpl.use("Agg")


# -- PettingZoo


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


def test_the_state_holds_every_vessel_and_buoy_and_zeros_for_who_is_gone() -> None:
    env = VesselsEnv(CROWDED)
    env.reset(seed=1)
    state = env.state()
    assert env.state_space.contains(state)
    vessels = state[: 5 * 12].reshape(5, 12)
    assert vessels[:, 0].tolist() == [1.0] * 5
    goals = env._env.state.goal[0]
    assert vessels[:, 10].tolist() == pytest.approx(goals.real.tolist())
    assert state[60:].reshape(4, 3)[:, 0].tolist() == [1.0] * 4
    env._env.state.active[0, 3] = False
    assert not env.state()[36:48].any()


def test_options_say_how_crowded_the_next_episodes_are() -> None:
    env = VesselsEnv(CROWDED)
    env.reset(seed=2, options={"robots": 2, "buoys": 1, "min_distance_m": 30.0})
    assert env.agents == ["vessel_0", "vessel_1"]
    assert env.state()[60:].reshape(4, 3)[:, 0].tolist() == [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(ConfigError, match="up to 5 and 4"):
        env.reset(options={"robots": 6})
    with pytest.raises(ConfigError, match="robots"):
        env.reset(options={"robots": 0})


def test_a_nan_action_is_refused_by_both() -> None:
    env, one = VesselsEnv(CROWDED), gymnasium.make("twinscrew/Vessel-v0")
    env.reset(seed=1)
    with pytest.raises(PolicyError, match="two finite numbers"):
        env.step({"vessel_0": np.array([np.nan, 0.0], np.float32)})
    one.reset(seed=1)
    with pytest.raises(PolicyError, match="two finite numbers"):
        one.step(np.array([0.0, np.inf], np.float32))


@pytest.mark.slow
def test_pictures_show_hulls_goals_and_buoys() -> None:
    env = VesselsEnv(CROWDED, render_mode="rgb_array")
    env.reset(seed=1)
    picture = env.render()
    assert picture is not None
    assert (picture.shape, picture.dtype) == ((480, 480, 3), np.uint8)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 1 + 1 + 1 + 5  # water, ring, buoy
    north_east = env._env.state.north_east[:, 0, 0]
    row, column = 480 - (north_east[0] + 5) / 65 * 480, (north_east[1] + 5) / 65 * 480
    hull = picture[int(row), int(column)]
    assert hull.tolist() == [31, 78, 140]  # north is up, east to the right
    render_test(lambda render_mode: parallel_to_aec(VesselsEnv(CROWDED, render_mode=render_mode)))
    with pytest.raises(ConfigError, match="render_mode"):
        VesselsEnv(render_mode="ascii")


# -- Gymnasium


def test_it_passes_gymnasiums_own_checks() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make("twinscrew/Vessel-v0", robots=4, buoys=2, render_mode="rgb_array")
        check_env(made.unwrapped)
        human = gymnasium.make("twinscrew/Vessel-v0", render_mode="human")
        human.reset(seed=0)
        human.step(np.zeros(2, np.float32))
        human.close()


def test_many_at_once_are_the_same_episodes_as_one_by_one_up_to_the_first_end() -> None:
    many = gymnasium.make_vec("twinscrew/Vessel-v0", num_envs=3)
    seeds = [7, 8, 9]
    seen, _ = many.reset(seed=seeds)
    alone = [gymnasium.make("twinscrew/Vessel-v0") for _ in seeds]
    first = [one.reset(seed=seed)[0] for one, seed in zip(alone, seeds, strict=True)]
    assert np.array_equal(seen, np.stack(first))
    for k in range(5):
        action = np.full((3, 2), 0.1 * k, np.float32)
        seen, reward, *_ = many.step(action)
        steps = [one.step(action[0]) for one in alone]
        assert np.array_equal(seen, np.stack([step[0] for step in steps]))
        assert reward.tolist() == pytest.approx([step[1] for step in steps])


def test_an_episode_that_is_over_begins_anew_in_the_same_step_and_gives_its_last_obs() -> None:
    settings = EnvironmentSettings(decision_limit=3)
    env = VesselVectorEnv(2, settings=settings)
    env.reset(seed=0)
    for _ in range(2):
        _, _, terminated, truncated, _ = env.step(np.zeros((2, 2), np.float32))
        assert not (terminated | truncated).any()
    seen, _, terminated, truncated, information = env.step(np.zeros((2, 2), np.float32))
    assert truncated.all()
    assert not terminated.any()
    assert information["_final_obs"].all()
    assert not np.array_equal(information["final_obs"][0], seen[0])
    assert not seen[:, 2:7].any()  # at rest


def test_when_the_own_vessel_ends_the_episode_ends_whatever_the_others_do() -> None:
    env = gymnasium.make("twinscrew/Vessel-v0", robots=3, others="still").unwrapped
    env.reset(seed=3)
    batch = env._vector._env
    batch.state.goal[0, 0] = batch.state.position[0, 0]
    _, reward, terminated, truncated, information = env.step(np.zeros(2, np.float32))
    assert (terminated, truncated, information["reached"]) == (True, False, True)
    assert reward > 9.0
    assert batch.state.active[0, 1:].all()


def test_others_may_be_steered_by_a_function_and_an_unknown_word_is_refused() -> None:
    asked = []

    def steer(seen):
        asked.append(seen.ego.shape)
        return np.zeros((1, 3, 2))

    env = gymnasium.make("twinscrew/Vessel-v0", others=steer)
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    assert asked == [(1, 3, 7)]
    with pytest.raises(ConfigError, match="'away' is not one of"):
        VesselVectorEnv(1, others="away")
    with pytest.raises(ConfigError, match="'wind' is not one of"):
        env.reset(options={"wind": 3})


def test_the_flat_view_is_the_row_in_documented_units() -> None:
    env = gymnasium.make("twinscrew/Vessel-v0")
    flat, _ = env.reset(seed=5)
    row = VectorEnv(env.unwrapped._vector.settings, 1, 5, auto_reset=False).reset().rows[0, 0]
    assert np.allclose(flat, row * flat_scale(5))
    assert np.abs(flat).max() < 5.0


# -- by itself

FORBIDDEN = [
    *("torch", "zenoh", "pymavlink", "rosbags", "mcap", "onnxruntime", "cryptography", "typer"),
    *("rich", "filterpy", "zstandard", "serial", "lxml", "ruamel", "lz4"),
]
ALONE = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in %r:
            raise ModuleNotFoundError(name, name=name)
sys.meta_path.insert(0, Refuse())
import gymnasium, numpy as np, twinscrew.training.gym as ours
env = gymnasium.make("twinscrew/Vessel-v0", render_mode="rgb_array")
env.reset(seed=0)
for _ in range(30):
    env.step(np.ones(2, np.float32) * 0.2)
env.render()
world = ours.VesselsEnv(seed=1)
world.reset()
world.step({agent: np.zeros(2, np.float32) for agent in world.agents})
import twinscrew.runtime.policy.colregs, twinscrew.training.scenarios
print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""


@pytest.mark.slow
def test_the_environment_works_without_zenoh_mavlink_rosbags_and_torch() -> None:
    """None of them is there to be imported, and none of the base's others is imported either."""
    words = [sys.executable, "-c", ALONE % FORBIDDEN]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    imported = set(done.stdout.split()) - set(sys.stdlib_module_names)
    known = {name for name in imported if not re.match(r"_|cython|scikit", name)}
    assert not known & set(FORBIDDEN)
    assert {"gymnasium", "pettingzoo", "numpy", "twinscrew"} <= known


@pytest.mark.slow
def test_ppo_of_stable_baselines_learns_by_the_shipped_script(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(sys, "argv", [str(EXAMPLE), "30000"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of another project's
        runpy.run_path(str(EXAMPLE), run_name="__main__")
    before, after = (float(n) for n in re.findall(r"-?\d+\.\d+", capsys.readouterr().out)[-2:])
    assert after > before + 5.0

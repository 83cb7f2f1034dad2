"""The training environment in other libraries' terms: Gymnasium and PettingZoo.

Importing this module registers `twinscrew/Vessel-v0`. `gymnasium.make` gives one vessel among
others that somebody else steers, with one flat, scaled observation: single-agent libraries such as
Stable-Baselines3 can learn in it. `gymnasium.make_vec(..., num_envs=64)` gives many such episodes.
`VesselsEnv` is PettingZoo's parallel environment: every vessel is an agent, and sees a dictionary:
ego (7,), objects (K, 5), mask (K,), raw SI units.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any, Literal

import gymnasium
import msgspec
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.settings import convert
from twinscrew.training.environment import (
    EnvironmentSettings,
    StepResult,
    VectorEnv,
    steer_at_goal,
)
from twinscrew.training.perception import Observations
from twinscrew.training.physics import State
from twinscrew.training.scenarios import ScenarioSettings, published_distance_m

Dict = dict[str, Any]
Others = Literal["goal", "still"] | Callable[[Observations], NDArray[np.floating]]
"""Who steers the other vessels: straight for their goals whatever is in the way; nobody; or a
function of what all vessels see that gives actions, (E, V, 2) in [-1, 1]."""
RENDER_MODES = ("rgb_array", "human")
OPTIONS = ("robots", "buoys", "min_distance_m")
"""What `reset(options=...)` takes: of the episodes from there on."""
BOUND = 10.0
"""[-] Scaled observations are clipped to +- this: goals up to 200 m away are told apart."""
PIXELS = 480
_EGO = np.array([1 / 20, 1 / 20, 1 / 3, 1 / 3, 1 / 0.7, 1e-3, 1e-3], np.float32)
_OBJECT = np.array([1 / 20, 1 / 20, 1 / 3, 1 / 3, 1 / 20], np.float32)


def flat_scale(objects: int) -> Float32:
    """Give the factors, (7 + 6 K,), that bring an observation's row to about one.

    Metres over 20, metres a second over 3, radians a second over 0.7, newtons over 1000.
    """
    return np.concatenate([_EGO, np.tile(_OBJECT, objects), np.ones(objects, np.float32)])


def _with_options(settings: EnvironmentSettings, options: Dict | None) -> EnvironmentSettings:
    """Give settings whose episodes follow `options`, with room for as much as before.

    Raises
    ------
    ConfigError
        An option is unknown or out of range, or more than there is room for.
    """
    if not options:
        return settings
    vessels, buoys, _ = settings.shape
    first = msgspec.to_builtins(settings.scenarios[0])
    for key in options:
        if key not in OPTIONS:
            raise ConfigError(one_of(key, OPTIONS), key="options")
    row = convert(first | {"weight": 1.0} | options, ScenarioSettings)
    if row.robots > vessels or row.buoys > buoys:
        raise ConfigError(
            f"{row.robots} vessels and {row.buoys} buoys; made for up to {vessels} and {buoys}",
            key="options",
        )
    room = ScenarioSettings(robots=vessels, buoys=buoys, min_distance_m=0.0, weight=0.0)
    return msgspec.structs.replace(settings, scenarios=(row, room))


class VesselVectorEnv(gymnasium.vector.VectorEnv[Float32, Float32, Any]):
    """Many episodes of one vessel among others, flat and scaled, reset within the step.

    Parameters
    ----------
    num_envs
        Episodes side by side.
    robots, buoys, min_distance_m
        Vessels (the own one included), buoys, and the least distance from starts to goals [m]; the
        paper's by default.
    settings
        Everything else; the published environment by default.
    others
        Who steers the other vessels.
    render_mode
        None, "rgb_array" or "human": the first episode.
    """

    metadata = {  # noqa: RUF012 - Gymnasium's own form
        "render_modes": list(RENDER_MODES),
        "render_fps": 2,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        robots: int = 3,
        buoys: int = 0,
        min_distance_m: float | None = None,
        settings: EnvironmentSettings | None = None,
        others: Others = "goal",
        render_mode: str | None = None,
    ) -> None:
        distance = published_distance_m(robots) if min_distance_m is None else min_distance_m
        values = {"robots": robots, "buoys": buoys, "min_distance_m": distance}
        row = convert(values, ScenarioSettings)
        base = settings or EnvironmentSettings()
        self.settings = msgspec.structs.replace(base, scenarios=(row,))
        self.num_envs, self.render_mode = num_envs, _checked_mode(render_mode)
        if not callable(others) and others not in ("goal", "still"):
            raise ConfigError(one_of(others, ("goal", "still", "a function")), key="others")
        self._others = others
        most = self.settings.observed_objects
        self._scale = flat_scale(most)
        self.single_observation_space = spaces.Box(-BOUND, BOUND, self._scale.shape, np.float32)
        self.single_action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._env: VectorEnv | None = None
        self._seen = Observations.empty((num_envs, robots), most)
        self._screen = Screen()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Dict | None = None
    ) -> tuple[Float32, Dict]:
        """Begin episodes anew: those of a seed, or of a seed for each; or the next ones.

        `options`: robots, buoys, min_distance_m of all episodes from here on.
        """
        one = seed if seed is None or isinstance(seed, int) else None
        super().reset(seed=one)
        if seed is not None or options or self._env is None:
            settings = _with_options(self.settings, options)
            if one is None and seed is not None:
                each = [self._drawn() if s is None else int(s) for s in seed]  # type: ignore[union-attr]
                self._env = VectorEnv(settings, 1, each, auto_reset=False)
            else:
                chosen = self._drawn() if one is None else one
                self._env = VectorEnv(settings, self.num_envs, chosen, auto_reset=False)
        self._seen = self._env.reset()
        self._show()
        return self._flat(self._seen), {}

    def step(
        self, actions: Float32
    ) -> tuple[Float32, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Dict]:
        """Let the own vessels, and the others, act for one decision.

        Raises
        ------
        PolicyError
            An action is not finite.
        """
        env = self._begun()
        everyone = np.zeros((self.num_envs, env.vessels, 2))
        if callable(self._others):
            everyone[:] = self._others(self._seen)
        elif self._others == "goal":
            everyone[:] = steer_at_goal(self._seen.ego)
        everyone[:, 0] = actions
        result = env.step(everyone)
        terminated, truncated = result.terminated[:, 0], result.truncated[:, 0]
        over, self._seen = np.flatnonzero(terminated | truncated), result.observation
        information: Dict = {
            "reached": result.reached[:, 0],
            "collided": result.collided[:, 0],
            "elapsed_s": result.elapsed_s,
        }
        if over.size:
            final = np.empty(self.num_envs, object)
            flat = self._flat(result.final_observation)
            for e in over:
                final[e] = flat[e]
            information["final_obs"] = final
            information["_final_obs"] = terminated | truncated
            if self._resets:
                env.restart(over, self._seen)
        self._show()
        return (
            self._flat(self._seen),
            result.reward[:, 0].astype(float),
            terminated,
            truncated,
            information,
        )

    _resets = True

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Give a picture of the first episode, (480, 480, 3), or show it."""
        if self.render_mode == "rgb_array":
            return picture(self._begun())
        self._show()
        return None

    def close_extras(self, **_: Any) -> None:
        """Close the window."""
        self._screen.close()

    def _show(self) -> None:
        if self.render_mode == "human":
            self._screen.show(picture(self._begun()))

    def _begun(self) -> VectorEnv:
        if self._env is None:
            raise gymnasium.error.ResetNeeded("call reset first")
        return self._env

    def _drawn(self) -> int:
        return int(self.np_random.integers(2**31))

    def _flat(self, seen: Observations) -> Float32:
        flat: Float32 = np.clip(seen.rows[:, 0] * self._scale, -BOUND, BOUND)
        return flat


class VesselEnv(gymnasium.Env[Float32, Float32]):
    """One vessel among others, flat and scaled: `VesselVectorEnv` with one episode.

    The parameters are those of `VesselVectorEnv`.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 2}  # noqa: RUF012

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        self._vector = VesselVectorEnv(1, render_mode=render_mode, **options)
        self._vector._resets = False  # noqa: SLF001 - who calls `step` resets
        self.render_mode = render_mode
        self.observation_space = self._vector.single_observation_space
        self.action_space = self._vector.single_action_space

    def reset(
        self, *, seed: int | None = None, options: Dict | None = None
    ) -> tuple[Float32, Dict]:
        """Begin an episode: that of `seed`, or the next one."""
        super().reset(seed=seed)
        seen, _ = self._vector.reset(seed=seed, options=options)
        return seen[0], {}

    def step(self, action: Float32) -> tuple[Float32, float, bool, bool, Dict]:
        """Let all vessels act for one decision; a `PolicyError` refuses what is not finite."""
        seen, reward, terminated, truncated, information = self._vector.step(
            np.asarray(action)[None]
        )
        over = bool(terminated[0] or truncated[0])
        last = information["final_obs"][0] if over else seen[0]
        known = {key: information[key][0] for key in ("reached", "collided", "elapsed_s")}
        plain = {key: value.item() for key, value in known.items()}
        return last, float(reward[0]), bool(terminated[0]), bool(truncated[0]), plain

    def render(self) -> NDArray[np.uint8] | None:
        """Give a picture, (480, 480, 3), or show it."""
        return self._vector.render()

    def close(self) -> None:
        """Close the window."""
        self._vector.close()


class VesselsEnv(ParallelEnv[str, Dict, Float32]):  # type: ignore[misc]
    """Vessels that share one map; agents are named vessel_0, vessel_1, ...

    Parameters
    ----------
    settings
        The environment; the published one by default.
    seed
        Of the first episode; `reset(seed=...)` sets another.
    render_mode
        None, "rgb_array" or "human".
    """

    metadata = {  # noqa: RUF012 - PettingZoo's own form
        "name": "twinscrew_v0",
        "render_modes": list(RENDER_MODES),
        "render_fps": 2,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        settings: EnvironmentSettings | None = None,
        seed: int = 0,
        render_mode: str | None = None,
    ) -> None:
        self.settings = settings or EnvironmentSettings()
        self.render_mode = _checked_mode(render_mode)
        vessels, buoys, _ = self.settings.shape
        self.possible_agents = [f"vessel_{number}" for number in range(vessels)]
        self.agents: list[str] = []
        seen = _observation_space(self.settings.observed_objects)
        self.observation_spaces = dict.fromkeys(self.possible_agents, seen)
        self.action_spaces = {
            agent: spaces.Box(-1.0, 1.0, (2,), np.float32) for agent in self.possible_agents
        }
        self.state_space = spaces.Box(-np.inf, np.inf, (12 * vessels + 3 * buoys,), np.float32)
        self._seed = seed
        self._env = VectorEnv(self.settings, 1, seed, auto_reset=False)
        self._screen = Screen()

    def observation_space(self, agent: str) -> spaces.Dict:
        """Give what an agent may see."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        """Give what an agent may do: rates of change of thrust, left and right, / 1000 N/s."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Dict | None = None
    ) -> tuple[dict[str, Dict], dict[str, Dict]]:
        """Begin an episode: that of `seed`, or the next one.

        `options`: robots, buoys, min_distance_m of this and all later episodes, up to what the
        settings have room for.
        """
        if options and seed is None:
            self._seed = seed = self._seed + 1
        if seed is not None:
            self._seed = seed
            known = {key: value for key, value in (options or {}).items() if key in OPTIONS}
            told = _with_options(self.settings, known)  # PettingZoo's checker passes unknown ones
            self._env = VectorEnv(told, 1, seed, auto_reset=False)
        seen = self._env.reset()
        self.agents = self._named(self._env.active[0])
        self._show()
        return self._views(seen, self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Float32]
    ) -> tuple[
        dict[str, Dict], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Dict]
    ]:
        """Let all vessels act at once; those that arrived or touched something leave.

        Raises
        ------
        PolicyError
            An action is not finite.
        """
        action = np.zeros((1, len(self.possible_agents), 2))
        for agent, value in actions.items():
            action[0, self.possible_agents.index(agent)] = value
        result = self._env.step(action)
        acted, self.agents = self.agents, self._named(self._env.active[0])
        index = {agent: self.possible_agents.index(agent) for agent in acted}
        self._show()
        return (
            self._views(result.final_observation, acted),
            {agent: float(result.reward[0, k]) for agent, k in index.items()},
            {agent: bool(result.terminated[0, k]) for agent, k in index.items()},
            {agent: bool(result.truncated[0, k]) for agent, k in index.items()},
            {agent: _information(result, k) for agent, k in index.items()},
        )

    def state(self) -> Float32:
        """Give everything at once, (12 V + 3 M,): vessels, then buoys; zeros where there is none.

        A vessel: there; north, east [m]; cosine and sine of its heading; surge, sway [m/s]; yaw
        rate [rad/s]; thrusts [N]; goal north, east [m]. A buoy: there; north, east [m].
        """
        return state_vector(self._env.state)

    def render(self) -> NDArray[np.uint8] | None:
        """Give a picture, (480, 480, 3), or show it."""
        if self.render_mode == "rgb_array":
            return picture(self._env)
        self._show()
        return None

    def close(self) -> None:
        """Close the window."""
        self._screen.close()

    def _show(self) -> None:
        if self.render_mode == "human":
            self._screen.show(picture(self._env))

    def _named(self, active: NDArray[np.bool_]) -> list[str]:
        return [agent for agent, there in zip(self.possible_agents, active, strict=True) if there]

    def _views(self, seen: Observations, agents: list[str]) -> dict[str, Dict]:
        names = ("ego", "objects", "mask")
        index = {agent: self.possible_agents.index(agent) for agent in agents}
        return {
            agent: {name: part[0, k].copy() for name, part in zip(names, seen, strict=True)}
            for agent, k in index.items()
        }


def _information(result: StepResult, vessel: int) -> Dict:
    """Say how a decision ended for one vessel."""
    return {
        "reached": bool(result.reached[0, vessel]),
        "touched_vessel": bool(result.touched_vessel[0, vessel]),
        "touched_buoy": bool(result.touched_buoy[0, vessel]),
        "elapsed_s": float(result.elapsed_s[0]),
    }


def _observation_space(objects: int) -> spaces.Dict:
    return spaces.Dict(
        {
            "ego": spaces.Box(-np.inf, np.inf, (7,), np.float32),
            "objects": spaces.Box(-np.inf, np.inf, (objects, 5), np.float32),
            "mask": spaces.Box(0.0, 1.0, (objects,), np.float32),
        }
    )


def state_vector(state: State) -> Float32:
    """Give the first episode's state as `VesselsEnv.state` describes it."""
    heading, there = state.heading[0], state.there[0]
    vessel = np.stack(
        [
            np.ones(len(there)),
            *state.north_east[:, 0],
            np.cos(heading),
            np.sin(heading),
            *state.nu[:, 0],
            *state.thrust[:, 0],
            state.goal[0].real,
            state.goal[0].imag,
        ],
        axis=-1,
    )
    buoy = np.stack([np.ones(len(state.buoy[0])), state.buoy[0].real, state.buoy[0].imag], axis=-1)
    vessel *= there[:, None]
    buoy *= state.buoy_there[0][:, None]
    return np.concatenate([vessel.ravel(), buoy.ravel()]).astype(np.float32)


# -- pictures -------------------------------------------------------------------------------------

_WATER, _GOAL, _BUOY = (214, 230, 240), (60, 150, 80), (230, 130, 30)
_HULLS = ((31, 78, 140), (150, 40, 40), (90, 60, 140), (20, 120, 120), (130, 100, 20))


def _checked_mode(mode: str | None) -> str | None:
    if mode is not None and mode not in RENDER_MODES:
        raise ConfigError(one_of(mode, RENDER_MODES), key="render_mode")
    return mode


def picture(env: VectorEnv) -> NDArray[np.uint8]:
    """Draw the first episode, north up: hulls, rings at their goals, buoys, (480, 480, 3)."""
    state, s = env.state, env.settings
    size = s.map.size_m
    axis = (np.arange(PIXELS) + 0.5) / PIXELS * (size + 10.0) - 5.0  # 5 m around the map
    place = axis[::-1, None] + 1j * axis[None, :]
    image = np.full((PIXELS, PIXELS, 3), _WATER, np.uint8)
    for buoy in state.buoy[0][state.buoy_there[0]]:
        image[np.abs(place - buoy) <= s.map.buoy_radius_m] = _BUOY
    for k in np.flatnonzero(state.there[0]):
        colour = _HULLS[k % len(_HULLS)]
        ring = np.abs(np.abs(place - state.goal[0, k]) - s.goal_radius_m) < 0.15
        image[ring] = _GOAL
        image[np.abs(place - state.goal[0, k]) < 0.4] = colour
        hull = (place - state.position[0, k]) * np.exp(-1j * state.heading[0, k])
        along, across = hull.real, np.abs(hull.imag)
        inside = (np.abs(along) <= s.vessel.length / 2) & (across <= s.vessel.width / 2)
        inside &= along + across <= s.vessel.length / 2 + 0.2 * s.vessel.width  # a bow
        image[inside] = colour
    return image


class Screen:
    """A window that shows pictures, by matplotlib."""

    def __init__(self) -> None:
        self._image: Any = None

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show the next picture."""
        import matplotlib.pyplot as plt

        if self._image is None:
            figure, axes = plt.subplots(num="twinscrew", clear=True)
            axes.set_axis_off()
            self._image = axes.imshow(image)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # there may be no screen
                figure.show()
        self._image.set_data(image)
        self._image.figure.canvas.draw_idle()
        self._image.figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window."""
        if self._image is not None:
            import matplotlib.pyplot as plt

            plt.close(self._image.figure)
            self._image = None


gymnasium.register(
    id="twinscrew/Vessel-v0",
    entry_point="twinscrew.training.gym:VesselEnv",
    vector_entry_point="twinscrew.training.gym:VesselVectorEnv",
)

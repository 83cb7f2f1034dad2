"""Sail given episodes: those of an experiment, or one own vessel among scripted others.

Scripted vessels are rectangles that hold course and speed (`twinscrew evaluate --traffic`). The own
vessel sees each as that rectangle, if its policy takes outlines; else as the circle around it,
radius 0.5 sqrt(length^2 + beam^2): the same rule that makes a WAM-V of 5.0 m x 2.5 m the circle of
2.795 m. Noise is the training environment's; the range of sight is the policy's. Contact is judged
between rectangles, the own one of the vessel's length and width, after every sub-step, and counts
for the own vessel alone.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.policy.hull_units import HullUnits
from twinscrew.training.encounters import (
    IMAZU,
    SETS,
    Encounter,
    Other,
    Own,
    Place,
    Traffic,
    draw_traffic,
    read_traffic,
)
from twinscrew.training.environment import RATE_LIMIT, EnvironmentSettings, VectorEnv
from twinscrew.training.evaluate import BatchPolicy, Evaluation, sail, score, shown_to
from twinscrew.training.perception import Observations
from twinscrew.training.physics import outside
from twinscrew.training.scenarios import Mask, Points, ScenarioSettings

__all__ = ["IMAZU", "SETS", "Encounter", "Other", "Own", "Traffic", "draw_traffic", "read_traffic"]

FILE = "beginnings.json"


# -- episodes of an experiment --------------------------------------------------------------------


class Given(NamedTuple):
    """E episodes of V vessels and M buoys; places are north + i east."""

    start: Points
    """(E, V) [m]"""
    heading: Float64
    """(E, V) [rad]"""
    goal: Points
    """(E, V) [m]"""
    buoy: Points
    """(E, M) [m]"""


class GivenEnv(VectorEnv):
    """The training environment at given beginnings; noise is drawn as ever."""

    def __init__(
        self, given: Given, settings: EnvironmentSettings, seed: int, scripted: int = 0
    ) -> None:
        """Take `settings` but for the scenario."""
        robots, buoys = given.start.shape[1], given.buoy.shape[1]
        row = ScenarioSettings(robots=robots, buoys=buoys, min_distance_m=0.0)
        only = msgspec.structs.replace(settings, scenarios=(row,))
        super().__init__(only, len(given.start), seed, auto_reset=False, scripted=scripted)
        self._given = given

    def reset(self) -> Observations:
        """Begin the given episodes."""
        super().reset()
        given, state = self._given, self.state
        state.position[:], state.goal[:] = given.start, given.goal
        state.north_east[0], state.north_east[1] = given.start.real, given.start.imag
        state.heading[:], state.buoy[:] = given.heading, given.buoy
        state.take_aim(np.arange(len(given.start)))
        return self.perception.observe(state, state.active)


def read_given(path: Path) -> dict[str, Given]:
    """Read an experiment's episodes, by set.

    Raises
    ------
    ConfigError
        The folder has no such file, or it cannot be read.
    """
    file = path / FILE if path.is_dir() else path
    try:
        sets = json.loads(file.read_text())["sets"]
        return {one["name"]: _given(one["episodes"]) for one in sets}
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise ConfigError(f"no episodes of an experiment ({error!r})", file=file) from error


def evaluate_given(
    policy: BatchPolicy,
    given: Given,
    seed: int = 0,
    environment: EnvironmentSettings | None = None,
) -> Evaluation:
    """Sail given episodes with one policy on every vessel; `seed` is of the noise."""
    settings = environment or EnvironmentSettings()
    settings = shown_to(policy, settings)
    return score(sail(GivenEnv(given, settings, seed), policy), seed)


def _given(episodes: list[dict[str, Any]]) -> Given:
    starts = np.array([one["starts"] for one in episodes], dtype=float)
    goals = np.array([one["goals"] for one in episodes], dtype=float)
    buoys = np.array([one["buoys"] for one in episodes], dtype=float).reshape(len(episodes), -1, 3)
    return Given(
        start=starts[..., 0] + 1j * starts[..., 1],
        heading=starts[..., 2],
        goal=goals[..., 0] + 1j * goals[..., 1],
        buoy=buoys[..., 0] + 1j * buoys[..., 1],
    )


# -- one vessel among scripted others -------------------------------------------------------------


class TrafficEnv(GivenEnv):
    """The training environment with one own vessel an episode among scripted ones."""

    def __init__(self, traffic: Traffic, settings: EnvironmentSettings, seed: int) -> None:
        episodes = traffic.episodes
        own = [one.own for one in episodes]
        given = Given(
            start=np.array([[complex(*one.start_m)] for one in own]),
            heading=np.radians([[one.heading_deg] for one in own]),
            goal=np.array([[complex(*one.goal_m)] for one in own]),
            buoy=np.zeros((len(own), 0), complex),
        )
        most = max(len(one.others) for one in episodes)
        super().__init__(given, settings, seed, scripted=most)
        shape = (len(episodes), most)
        self._start, self._velocity = np.zeros((2, *shape), complex)
        self._course, self._present = np.zeros(shape), np.zeros(shape, bool)
        self._half = np.zeros((*shape, 2))  # [m] of the rectangles: along, across
        for e, one in enumerate(episodes):
            for t, other in enumerate(one.others):
                self._start[e, t] = complex(*other.start_m)
                self._course[e, t] = np.radians(other.course_deg)
                self._velocity[e, t] = other.speed_mps * np.exp(1j * self._course[e, t])
                self._half[e, t] = other.length_m / 2, other.beam_m / 2
                self._present[e, t] = True
        self.closest_m = np.full(len(episodes), np.inf)
        """[m] (E,) Least distance of the own outline from another one so far."""

    def reset(self) -> Observations:
        """Begin the episodes; the others begin with them."""
        state = self.state
        state.scripted[:], state.scripted_velocity[:] = self._start, self._velocity
        state.scripted_radius[:] = np.hypot(self._half[..., 0], self._half[..., 1])
        state.scripted_half[:], state.scripted_heading[:] = self._half, self._course
        state.scripted_outlined[:] = self.settings.extended
        return super().reset()

    def touched(self) -> tuple[Mask, Mask]:
        """Tell which own vessels touched another one in the decision just made."""
        nobody = np.zeros(self.state.shape, bool)
        if not self._present.any():
            return nobody, nobody
        gap = self._gaps().min(axis=0)
        gap[~self._present] = np.inf
        least = np.where(self.state.active[:, 0], gap.min(axis=1), np.inf)
        self.closest_m = np.minimum(self.closest_m, least)
        return (least <= 0.0)[:, None] & self.state.active, nobody

    def _gaps(self) -> Float64:
        """Give distances between outlines, (S + 1, E, T) [m], at and after every sub-step."""
        motion, state, s = self.physics.motion, self.state, self.settings
        own = motion.trajectory[:, 0] + 1j * motion.trajectory[:, 1]
        times = s.substep_s * np.arange(len(own)) - s.period_s  # the others are at the end already
        theirs = state.scripted + state.scripted_velocity * times[:, None, None]
        half = np.array([s.vessel.length / 2, s.vessel.width / 2])
        return rectangles_gap(
            theirs - own[..., None], motion.headings[..., None], half, self._course, self._half
        )


def rectangles_gap(
    between: NDArray[np.complex128],
    heading: Float64,
    half: Float64,
    other_heading: Float64,
    other_half: Float64,
) -> Float64:
    """Give the distance between two rectangles [m]; 0 where they touch. All broadcast.

    The nearest points of two rectangles apart include a corner of one of them, and rectangles
    overlap unless one of their four axes separates them.

    Parameters
    ----------
    between : (...) complex
        [m] [N] From the first centre to the other.
    heading, other_heading : (...) float
        [rad]
    half, other_half : (..., 2) float
        [m] Half of length and beam.
    """
    turn = np.exp(1j * (np.asarray(other_heading) - heading))
    seen = between * np.exp(-1j * np.asarray(heading))  # the other's centre in the first's frame
    back = -seen * turn.conj()  # the first's centre in the other's frame
    apart_1, clear_1 = _corners(seen, turn, half, other_half)
    apart_2, clear_2 = _corners(back, turn.conj(), other_half, half)
    gap: Float64 = np.where(clear_1 | clear_2, np.minimum(apart_1, apart_2), 0.0)
    return gap


def _corners(
    centre: NDArray[np.complex128], turn: NDArray[np.complex128], half: Float64, other: Float64
) -> tuple[Float64, Mask]:
    """Give the least distance of another rectangle's corners from one that lies along the axes.

    And whether one of the axes separates the two.
    """
    signs = np.array([1 + 1j, 1 - 1j, -1 - 1j, -1 + 1j])
    corner = other[..., None, 0] * signs.real + 1j * other[..., None, 1] * signs.imag
    corners = centre[..., None] + turn[..., None] * corner
    apart: Float64 = outside(corners, half[..., None, :]).min(axis=-1)
    clear = np.zeros(apart.shape, bool)
    for part, limit in ((corners.real, half[..., 0]), (corners.imag, half[..., 1])):
        clear |= (part.min(axis=-1) > limit) | (part.max(axis=-1) < -limit)
    return apart, clear


def in_hull_units(traffic: Traffic, units: HullUnits) -> Traffic:
    """Give the same episodes in a hull's own units."""
    length, speed, change = units.length, units.speed, msgspec.structs.replace

    def place(where: Place) -> Place:
        return where[0] / length, where[1] / length

    return Traffic(
        time_limit_s=traffic.time_limit_s / units.time,
        episodes=tuple(
            Encounter(
                own=change(one.own, start_m=place(one.own.start_m), goal_m=place(one.own.goal_m)),
                others=tuple(
                    change(
                        other,
                        start_m=place(other.start_m),
                        speed_mps=other.speed_mps / speed,
                        length_m=other.length_m / length,
                        beam_m=other.beam_m / length,
                    )
                    for other in one.others
                ),
            )
            for one in traffic.episodes
        ),
    )


def evaluate_traffic(
    policy: BatchPolicy,
    traffic: Traffic,
    seed: int = 0,
    environment: EnvironmentSettings | None = None,
    units: HullUnits | None = None,
) -> dict[str, Any]:
    """Sail the episodes of a traffic file, the policy on the own vessel; give plain values.

    The environment and the policy are in `units` of the own hull; the file and the answer in SI.
    """
    length, second, _ = units or (1.0, 1.0, 1.0)
    if units is not None:
        traffic = in_hull_units(traffic, units)
    settings = environment or EnvironmentSettings()
    settings = msgspec.structs.replace(shown_to(policy, settings), range_m=policy.range_m)
    env = TrafficEnv(traffic, settings, seed)
    seen, active = env.reset(), env.active
    policy.begin(*active.shape)
    outcome = np.full(env.episodes, "timeout", object)
    time_s = np.full(env.episodes, traffic.time_limit_s)
    for _ in range(int(traffic.time_limit_s / env.settings.period_s + 1e-9)):
        result = env.step(policy.rates(seen, active) / RATE_LIMIT)
        for word, which in (("arrived", result.reached), ("contact", result.collided)):
            outcome[which[:, 0]] = word
            time_s[which[:, 0]] = result.elapsed_s[which[:, 0]]
        seen, active = result.observation, env.active
        if not active.any():
            break
    arrived = outcome == "arrived"
    gaps = length * env.closest_m
    closest = [None if np.isinf(gap) else round(float(gap), 3) for gap in gaps]
    return {
        "success_rate": float(arrived.mean()),
        "contacts": int((outcome == "contact").sum()),
        "timeouts": int((outcome == "timeout").sum()),
        "travel_time_s": float(second * time_s[arrived].mean()) if arrived.any() else None,
        "episodes": [
            {"outcome": word, "time_s": float(second * time), "closest_approach_m": gap}
            for word, time, gap in zip(outcome, time_s, closest, strict=True)
        ],
    }

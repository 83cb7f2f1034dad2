"""A search for counter-examples: motions of another vessel against which the assurance fails.

A boat holds a command that knows nothing of the other; the assurance alone stands between the two.
The other keeps course and speed within stated bounds, and is seen exactly. The covariance matrix
adaptation evolution strategy (Hansen 2016, The CMA evolution strategy: a tutorial) looks for the
motion that brings the two nearest; where it has converged it begins anew. A contact counts as
avoidable if one of a few plain manoeuvres, begun at the beginning and held, would have avoided it:
what is not among them may be avoidable, too, so that the count is a lower bound.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, structs

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Float64, Odometry, Tracks
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.safety.assurance import Assurance, AssuranceSettings
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.settings import NonNegative, Positive, Settings

CHECK_S, STEP_S = 0.1, 0.05
"""[s] Between two checks, as of a LiDAR at 10 Hz; and of the simulated vessel."""
DECISION_CHECKS = 5
"""[-] A decision of the policy every so many checks."""
DIMENSIONS = 10
POPULATION, SIGMA = 12, 0.3
RESTART_SIGMA = 0.01
"""[-] Of a unit box: a search that is narrower has converged."""


class Bounds(Settings, frozen=True, kw_only=True):
    """What the other may do, and for how long it is looked at."""

    speed_mps: tuple[NonNegative, NonNegative] = (0.5, 2.5)
    """[m/s] It goes at least and at most so fast."""
    radius_m: tuple[Positive, Positive] = (0.8, 2.8)
    """[m] Of the circle around it."""
    wander_deg: NonNegative = 5.0
    """[deg] Its course swings about its mean by at most so much,"""
    wander_speed: Annotated[float, Meta(ge=0.0, lt=1.0)] = 0.1
    """[-] its speed differs from what it was by at most this share."""
    meet_s: tuple[Positive, Positive] = (4.0, 15.0)
    """[s] It would meet the boat, which goes straight on, so long after it is first seen."""
    aim_m: NonNegative = 6.0
    """[m] Or pass that place by so much."""
    begins_m: NonNegative = 3.0
    """[m] It begins at least so far off, surface to surface."""
    duration_s: Positive = 20.0


@dataclass(frozen=True, slots=True)
class Motion:
    """One try: what both do."""

    surge_mps: float
    """[m/s] The boat's speed at the beginning; it heads north from the origin."""
    command_n: tuple[float, float]
    """[N] What it asks of its propellers, left and right, all the time."""
    place_m: tuple[float, float]
    """[m] Where the other begins,"""
    course: float
    """[rad] how it goes on average,"""
    speed_mps: float
    radius_m: float
    wander: float
    """[rad] and by how much its course swings, over the whole time once;"""
    change_mps: float
    """[m/s] its speed changes by this, evenly, over the whole time."""


@dataclass(frozen=True, slots=True)
class Tried:
    """What became of a try."""

    motion: Motion
    gap_m: float
    """[m] The least between the two's surfaces."""
    avoidable: bool
    """Whether a plain manoeuvre would have avoided the contact; False without one."""


@dataclass(frozen=True, slots=True)
class Search:
    """What a search found."""

    tries: int
    contacts: int
    avoidable: tuple[Tried, ...]
    """Contacts that a plain manoeuvre would have avoided, the worst first."""
    nearest_m: float
    """[m] The least gap of all tries."""
    check_ms: tuple[float, float, float]
    """[ms] Of the processor a check takes: median, 99 %, greatest."""

    def record(self, bounds: Bounds, shown: int = 5) -> dict[str, Any]:
        """Give what `twinscrew falsify --json` prints."""
        return {
            "tries": self.tries,
            "contacts": self.contacts,
            "avoidable": len(self.avoidable),
            "nearest_m": round(self.nearest_m, 3),
            "check_ms": dict(zip(("p50", "p99", "max"), self.check_ms, strict=True)),
            "bounds": structs.asdict(bounds),
            "worst": [
                {"gap_m": round(one.gap_m, 3)}
                | {name: getattr(one.motion, name) for name in one.motion.__slots__}
                for one in self.avoidable[:shown]
            ],
        }


def search(
    tries: int,
    seed: int = 0,
    bounds: Bounds | None = None,
    settings: AssuranceSettings | None = None,
    progress: Callable[[int], None] | None = None,
) -> Search:
    """Look for counter-examples in so many tries.

    Raises
    ------
    ConfigError
        The optimiser is not installed.
    """
    cma = _optimiser()
    limits, rng = bounds or Bounds(), np.random.default_rng(seed)
    checks: list[float] = []
    found: list[Tried] = []
    done, contacts, nearest = 0, 0, math.inf
    while done < tries:
        options = {
            "seed": int(rng.integers(1, 2**31)),
            "popsize": POPULATION,
            "bounds": [0.0, 1.0],
            "verbose": -9,
        }
        strategy = cma.CMAEvolutionStrategy(rng.uniform(size=DIMENSIONS), SIGMA, options)
        while done < tries and strategy.sigma > RESTART_SIGMA and not strategy.stop():
            asked = strategy.ask()
            costs = []
            for unit in asked:
                one = attempt(motion_of(np.asarray(unit), limits), limits, settings, checks)
                touched = one.gap_m <= 0.0
                contacts += touched
                nearest = min(nearest, one.gap_m)
                if one.avoidable:
                    found.append(one)
                # What cannot be avoided is of no interest: the search turns away from it.
                costs.append(one.gap_m if one.avoidable or not touched else 1.0 - one.gap_m)
            strategy.tell(asked, costs)
            done += len(asked)
            if progress is not None:
                progress(min(done, tries))
    p50, p99 = np.percentile(checks, (50, 99)).tolist() if checks else (math.nan, math.nan)
    most = max(checks, default=math.nan)
    return Search(
        tries=done,
        contacts=contacts,
        avoidable=tuple(sorted(found, key=lambda one: one.gap_m)),
        nearest_m=nearest,
        check_ms=(round(p50, 4), round(p99, 4), round(most, 4)),
    )


def _optimiser() -> Any:
    try:
        import cma
    except ImportError as error:
        raise ConfigError(
            f"the search needs cma ({error}): pip install 'twinscrew[judge]'", key="falsify"
        ) from error
    return cma


def motion_of(unit: Float64, bounds: Bounds) -> Motion:
    """Give the motion that a point of the unit box, (10,), stands for."""
    u = np.clip(unit, 0.0, 1.0).tolist()
    model = VesselParameters()
    surge = u[0] * model.top_speed
    mean, half = 1000.0 * u[1], 300.0 * (2.0 * u[2] - 1.0)
    bearing = math.pi * (2.0 * u[3] - 1.0)
    speed = bounds.speed_mps[0] + u[4] * (bounds.speed_mps[1] - bounds.speed_mps[0])
    radius = bounds.radius_m[0] + u[5] * (bounds.radius_m[1] - bounds.radius_m[0])
    meet_s = bounds.meet_s[0] + u[6] * (bounds.meet_s[1] - bounds.meet_s[0])
    off = bounds.aim_m * (2.0 * u[7] - 1.0)
    meet = complex(surge * meet_s, 0.0)
    along = complex(math.cos(bearing), math.sin(bearing))
    place = meet + off * 1j * along - speed * meet_s * along
    return Motion(
        surge_mps=surge,
        command_n=(mean + half, mean - half),
        place_m=(place.real, place.imag),
        course=bearing,
        speed_mps=speed,
        radius_m=radius,
        wander=math.radians(bounds.wander_deg) * (2.0 * u[8] - 1.0),
        change_mps=speed * bounds.wander_speed * (2.0 * u[9] - 1.0),
    )


def attempt(
    motion: Motion,
    bounds: Bounds | None = None,
    settings: AssuranceSettings | None = None,
    checks: list[float] | None = None,
) -> Tried:
    """Sail one try; what each check took of the processor [ms] is added to `checks`."""
    limits = bounds or Bounds()
    others_N, others_v = _others(motion, limits.duration_s)
    own_radius = _own_radius(settings)
    first = math.hypot(*motion.place_m) - motion.radius_m - own_radius
    if first < limits.begins_m:
        return Tried(motion, limits.begins_m - first + 1.0, avoidable=False)
    assured = _sail(motion, others_N, others_v, settings, [] if checks is None else checks)
    gap = _least_gap(assured[:, None], others_N, motion.radius_m, own_radius)[0]
    avoidable = False
    if gap <= 0.0:
        plain = _plain_manoeuvres(motion, len(others_N))
        avoidable = bool((_least_gap(plain, others_N, motion.radius_m, own_radius) > 0.0).any())
    return Tried(motion, float(gap), avoidable)


def _own_radius(settings: AssuranceSettings | None) -> float:
    """[m] Give the radius of the circle in which the boat is kept from contact."""
    return (settings or AssuranceSettings()).vessel.extent_m


def _others(motion: Motion, duration_s: float) -> tuple[Float64, Float64]:
    """Give where the other is, and how it goes, at every step: (T, 2) [m], (T, 2) [m/s]."""
    t = STEP_S * np.arange(round(duration_s / STEP_S) + 1)
    phase = t / duration_s
    course = motion.course + motion.wander * np.sin(2.0 * math.pi * phase)
    speed = motion.speed_mps + motion.change_mps * phase
    v = np.column_stack([speed * np.cos(course), speed * np.sin(course)])
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(STEP_S * v[:-1], axis=0)])
    return motion.place_m + way, v


def _sail(
    motion: Motion,
    others_N: Float64,
    others_v: Float64,
    settings: AssuranceSettings | None,
    checks: list[float],
) -> Float64:
    """Give where the boat goes with the assurance, (T, 2) [m] N."""
    model, assurance = VesselModel(), Assurance(settings)
    pose, nu = np.zeros(3), np.array([motion.surge_mps, 0.0, 0.0])
    thrust = np.array(motion.command_n)
    places = np.empty((len(others_N), 2))
    every = round(CHECK_S / STEP_S)
    for k in range(len(others_N)):
        places[k] = pose[:2]
        if k % every == 0:
            stamp_ns = round(1e9 * STEP_S * k)
            odometry = Odometry(
                stamp_ns=stamp_ns,
                position_N=np.array([pose[0], pose[1], 0.0]),
                q_NB=quaternion_from_euler(0.0, 0.0, float(pose[2])),
                velocity_B=np.array([nu[0], nu[1], 0.0]),
                rates_B=np.array([0.0, 0.0, nu[2]]),
            )
            tracks = _seen(stamp_ns, others_N[k], others_v[k], motion.radius_m)
            decided = (k // every) % DECISION_CHECKS == 0
            begin_s = time.thread_time()
            command = np.array(motion.command_n)
            thrust, _ = assurance.step(odometry, tracks, thrust, command, decided=decided)
            checks.append(1e3 * (time.thread_time() - begin_s))
        pose, nu = model.step(pose, nu, thrust, STEP_S)
    return places


def _seen(stamp_ns: int, p_N: Float64, v_N: Float64, radius: float) -> Tracks:
    return Tracks(
        stamp_ns=stamp_ns,
        id=np.zeros(1, np.int64),
        p_N=p_N[None].copy(),
        v_N=v_N[None].copy(),
        radius=np.array([radius]),
        covariance=np.zeros((1, 4, 4)),
        age_s=np.zeros(1),
    )


def _plain_manoeuvres(motion: Motion, steps: int) -> Float64:
    """Give where the boat goes on each plain manoeuvre, (T, M, 2) [m] N: no assurance in it.

    Full ahead, both full turns on the way, both on the spot, astern until it stands, and no thrust.
    """
    limits = ThrustLimits()
    ahead, astern = limits.max_n, limits.min_n
    wanted = np.array(
        [
            *((ahead, ahead), (ahead, 0.0), (0.0, ahead), (ahead, astern), (astern, ahead)),
            *((astern, astern), (0.0, 0.0)),
        ]
    )
    model = VesselModel()
    count = len(wanted)
    pose, nu = np.zeros((count, 3)), np.tile([motion.surge_mps, 0.0, 0.0], (count, 1))
    thrust = np.tile(motion.command_n, (count, 1))
    places = np.empty((steps, count, 2))
    slew = AssuranceSettings().slew_nps * STEP_S
    for k in range(steps):
        places[k] = pose[:, :2]
        target = np.where((wanted == astern).all(axis=1) & (nu[:, 0] <= 0.0), 0.0, wanted.T).T
        thrust = thrust + np.clip(target - thrust, -slew, slew)
        pose, nu = model.step(pose, nu, thrust, STEP_S)
    return places


def _least_gap(own_N: Float64, others_N: Float64, radius: float, own_radius: float) -> Float64:
    """Give the least distance between surfaces of boats on tracks (T, M, 2), (M,) [m]."""
    offset = own_N - others_N[:, None]
    distance = np.hypot(offset[..., 0], offset[..., 1])
    least: Float64 = distance.min(axis=0) - radius - own_radius
    return least

"""Encounters of one own vessel with others that hold course and speed: given in a file, or drawn.

Plain data and numpy alone: the training environment sails them (`traffic`), and the simulator as
scenarios (`twinscrew.hil_sim.scenario.SERIES`).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta

from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError
from twinscrew.runtime.settings import Positive, Settings, convert

Finite = Annotated[float, Meta(ge=-1e6, le=1e6)]
Place = tuple[Finite, Finite]
"""[m] North, east."""


class Own(Settings, frozen=True):
    """The vessel that the policy steers."""

    start_m: Place
    heading_deg: Finite
    """[deg] Clockwise from north."""
    goal_m: Place


class Other(Settings, frozen=True):
    """A vessel that holds course and speed, whatever happens."""

    start_m: Place
    """[m] Of its centre."""
    course_deg: Finite
    """[deg] Clockwise from north; it points where it goes."""
    speed_mps: Annotated[float, Meta(ge=0.0, le=100.0)]
    length_m: Annotated[float, Meta(gt=0.0, le=1000.0)]
    beam_m: Annotated[float, Meta(gt=0.0, le=1000.0)]


class Encounter(Settings, frozen=True):
    """One episode."""

    own: Own
    others: tuple[Other, ...] = ()


class Traffic(Settings, frozen=True):
    """What a traffic file holds."""

    episodes: Annotated[tuple[Encounter, ...], Meta(min_length=1)]
    time_limit_s: Positive = 90.0
    """[s] Longer than this under way is a failure."""


def read_traffic(file: Path) -> Traffic:
    """Read a traffic file.

    Raises
    ------
    ConfigError
        Names the file, the key, the value and what is allowed.
    """
    try:
        values = json.loads(file.read_bytes())
    except OSError as error:
        raise ConfigError(error.strerror or str(error), file=file) from error
    except NOT_THE_FORMAT as error:
        words = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ConfigError(f"not JSON: {words}", file=file) from error
    return convert(values, Traffic, file=file)


class _Set(NamedTuple):
    """One row of the traffic table; ranges are (least, greatest)."""

    others: tuple[int, int]
    speed_mps: tuple[float, float]
    length_m: tuple[float, float]
    beam: float
    """[-] Of the length."""


SETS = {
    "slow": _Set((1, 4), (0.5, 2.5), (5.0, 5.0), 0.5),
    "fast": _Set((1, 3), (2.5, 5.0), (5.0, 5.0), 0.5),
    "large": _Set((1, 2), (0.5, 3.0), (7.2, 17.9), 0.5),  # radii 4 to 10 m
    "anchored": _Set((1, 4), (0.0, 0.0), (1.8, 8.9), 0.5),  # radii 1 to 5 m
}
"""Others that hold course and speed, aimed to meet the own vessel's straight way."""
IMAZU: tuple[tuple[float, ...], ...] = (
    *((180,), (270,), (0,), (45,)),
    *((180, 270), (350, 315), (0, 315), (180, 90), (330, 270), (270, 15), (90, 330)),
    *((180, 315, 350), (180, 10, 45), (350, 315, 270), (0, 315, 270), (45, 90, 270)),
    *((0, 10, 315), (225, 345, 330), (15, 345, 225), (0, 345, 270), (345, 15, 270), (0, 315, 270)),
)
"""[deg] Courses of the others in Imazu's 22 encounters (1987), the own vessel's being 0. Unaltered,
all meet at one point at one time; who sails the own course is slower, and overtaken. The scale is
ours: 8 lengths of the default vessel from the start to that point."""
IMAZU_SLOW, IMAZU_HALF_WAY_M = 0.4, 40.0
HALF_WAY_M, OWN_SPEED_MPS = 20.0, 2.5
"""[m], [m/s] From the start to the middle of the own way; about the own speed on it."""


def draw_traffic(name: str, episodes: int, seed: int) -> Traffic:
    """Draw the episodes of one of the `SETS`, or of "imazu": its 22 encounters in turn, jittered.

    Raises
    ------
    ConfigError
        There is no such set.
    """
    if name not in SETS and name != "imazu":
        allowed = ", ".join((*SETS, "imazu"))
        raise ConfigError(f"no such file or set; sets are {allowed}, got {name!r}", key="--traffic")
    generator = np.random.default_rng([seed, sum(name.encode())])
    made: list[Encounter] = []
    while len(made) < episodes:
        heading = generator.uniform(-np.pi, np.pi)
        far = IMAZU_HALF_WAY_M if name == "imazu" else HALF_WAY_M
        half = far * np.exp(1j * heading)
        if name == "imazu":
            others = _imazu(IMAZU[len(made) % len(IMAZU)], heading, generator)
        else:
            others = _aimed(SETS[name], half, generator)
        if others:
            own = Own(_place(-half), float(np.degrees(heading)), _place(half))
            made.append(Encounter(own, tuple(others)))
    return Traffic(tuple(made))


def _place(where: complex) -> Place:
    return float(where.real), float(where.imag)


def _aimed(kind: _Set, half: complex, g: np.random.Generator) -> list[Other]:
    """Draw others that meet the own way, at least 12 m clear of the start and 8 m of the goal."""
    others = []
    for _ in range(int(g.integers(kind.others[0], kind.others[1] + 1))):
        length, speed = g.uniform(*kind.length_m), g.uniform(*kind.speed_mps)
        after_s, course = g.uniform(6.0, 16.0), g.uniform(-np.pi, np.pi)
        along = min(OWN_SPEED_MPS * after_s, 34.0) / (2 * HALF_WAY_M)
        meet = half * (2 * along - 1) + complex(*g.uniform(-3.0, 3.0, 2))
        start = meet - speed * after_s * np.exp(1j * course)
        beam, around = kind.beam * length, np.hypot(length, kind.beam * length) / 2
        if abs(start + half) > 12.0 + around and abs(start - half) > 8.0 + around:
            others.append(Other(_place(start), float(np.degrees(course)), speed, length, beam))
    return others


def imazu(case: int) -> Encounter:
    """Give one of Imazu's 22 encounters, from 1, as it is: no jitter, the own course north."""
    after_s = IMAZU_HALF_WAY_M / OWN_SPEED_MPS
    others = []
    for course in IMAZU[case - 1]:
        speed = OWN_SPEED_MPS * (IMAZU_SLOW if course == 0 else 1.0)
        start = -speed * after_s * np.exp(1j * np.radians(course))
        others.append(Other(_place(start), course, speed, 5.0, 2.5))
    own = Own((-IMAZU_HALF_WAY_M, 0.0), 0.0, (IMAZU_HALF_WAY_M, 0.0))
    return Encounter(own, tuple(others))


def _imazu(courses: tuple[float, ...], heading: float, g: np.random.Generator) -> list[Other]:
    """Draw an encounter of Imazu's: courses within 5 degrees, speeds within a tenth, 1 m."""
    others, after_s = [], IMAZU_HALF_WAY_M / OWN_SPEED_MPS
    for course in courses:
        slow = IMAZU_SLOW if course == 0 else 1.0
        speed = OWN_SPEED_MPS * slow * g.uniform(0.9, 1.1)
        way = heading + np.radians(course + g.uniform(-5.0, 5.0))
        start = complex(*g.normal(0.0, 1.0, 2)) - speed * after_s * np.exp(1j * way)
        others.append(Other(_place(start), float(np.degrees(way)), speed, 5.0, 2.5))
    return others

import itertools
import time
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.training.harbours import (
    CurrentField,
    Harbour,
    HarbourSettings,
    Kind,
    draw_current,
    draw_harbour,
    edges_of,
    inside,
)

KINDS = get_args(Kind)
HULLS = ((5.0, 2.5), (1.2, 0.93), (12.0, 3.0))


def _draw(seed: int, kind: str, hull: tuple[float, float] = HULLS[0], **more: object) -> Harbour:
    values = {"kinds": [kind], "length_m": hull[0], "beam_m": hull[1], **more}
    return draw_harbour(np.random.default_rng(seed), convert(values, HarbourSettings))


def _along(way: np.ndarray, step_m: float) -> np.ndarray:
    """Give places on a way, at most a step apart."""
    parts = [
        np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / step_m)) for a, b in itertools.pairwise(way)
    ]
    return np.concatenate(parts)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(KINDS), st.sampled_from(HULLS))
def test_every_vessel_starts_clear_and_has_a_way_that_keeps_its_clearance(
    seed: int, kind: str, hull: tuple[float, float]
) -> None:
    harbour, (length, beam) = _draw(seed, kind, hull), hull
    corner_m = np.hypot(length, beam) / 2
    assert (harbour.distance_m(harbour.starts[:, :2]) > corner_m).all()
    assert (harbour.distance_m(harbour.goals) > corner_m).all()
    for n, way in enumerate(harbour.ways):
        assert np.array_equal(way[0], harbour.starts[n, :2])
        assert np.array_equal(way[-1], harbour.goals[n])
        least = harbour.distance_m(_along(way, 0.1 * length)).min()
        assert least >= 0.73 * beam
        assert least >= harbour.clearance_m[n] - 1e-3 * length
    apart = np.hypot(*(harbour.goals[:, None] - harbour.goals[None]).T) + 9e9 * np.eye(3)
    assert apart.min() >= 2.0 * length - 1e-6
    straight = np.hypot(*(harbour.goals - harbour.starts[:, :2]).T)
    assert straight.min() >= 4.0 * length - 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_the_seed_alone_decides_and_other_seeds_differ(kind: str) -> None:
    first, again, other = (_draw(seed, kind, current_mps=(0.1, 1.0)) for seed in (3, 3, 4))
    for a, b in zip(first.rings, again.rings, strict=True):
        assert np.array_equal(a, b)
    assert np.array_equal(first.starts, again.starts)
    assert all(np.array_equal(a, b) for a, b in zip(first.current, again.current, strict=True))
    assert not np.array_equal(first.starts, other.starts)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(KINDS))
def test_a_larger_hull_gets_the_same_harbour_larger(seed: int, kind: str) -> None:
    small, large = _draw(seed, kind, (2.0, 1.0)), _draw(seed, kind, (6.0, 3.0))
    assert np.allclose(3.0 * small.starts[:, :2], large.starts[:, :2])
    for a, b in zip(small.rings, large.rings, strict=True):
        assert np.allclose(3.0 * a, b)


def test_harbours_are_turned_by_every_angle() -> None:
    walls = [_draw(seed, "gap").land[0] for seed in range(40)]
    angle = [np.arctan2(*(ring[1] - ring[0])) % np.pi for ring in walls]
    counts, _ = np.histogram(angle, bins=4, range=(0.0, np.pi))
    assert (counts >= 3).all()


def test_land_lies_to_one_side_of_its_edges_and_nothing_leaves_the_map() -> None:
    for seed, kind in enumerate(KINDS):
        harbour = _draw(seed, kind)
        for ring in harbour.rings:
            x, y = ring.T
            assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0.0
        everything = np.concatenate([*harbour.rings, *harbour.ways])
        assert (everything >= 0.0).all()
        assert (everything <= np.array(harbour.size_m)).all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.floats(1.6, 6.0))
def test_the_gap_is_as_wide_as_asked_and_the_ways_lead_through_it(seed: int, beams: float) -> None:
    harbour = _draw(seed, "gap", gap_beams=(beams, beams))
    left, right = harbour.land
    facing = left[:, None] - right[None]
    assert np.isclose(np.hypot(facing[..., 0], facing[..., 1]).min(), beams * 2.5)
    ends = np.array([[left[0], right[0]], [left[-1], right[-1]]])
    middle = ends.mean(axis=(0, 1))
    for way in harbour.ways:
        assert np.hypot(*(_along(way, 0.1) - middle).T).min() < beams * 2.5 / 2


def test_draws_hold_shores_that_are_not_convex_and_fences_that_are_not_convex() -> None:
    def dented(ring: np.ndarray) -> bool:
        a, b = ring - np.roll(ring, 1, 0), np.roll(ring, -1, 0) - ring
        return bool((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0.0).any())

    fences = [_draw(seed, "fenced").fence for seed in range(20)]
    assert sum(dented(fence) for fence in fences if fence is not None) >= 10
    for kind in ("basin", "dead_end", "fingers", "gap"):
        assert dented(_draw(1, kind).land[0])


def test_a_hundred_are_drawn_in_a_second() -> None:
    kept, rng = HarbourSettings(), np.random.default_rng(0)
    draw_harbour(rng, kept)
    began = time.process_time()
    for _ in range(30):
        draw_harbour(rng, kept)
    assert time.process_time() - began < 30 * 0.05  # 5 ms each on a quiet core


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match="ask for fewer"):
        _draw(0, "open", vessels=8, apart_lengths=30.0)
    with pytest.raises(ConfigError, match="leaves no clearance"):
        convert({"gap_beams": [1.0, 2.0]}, HarbourSettings)
    with pytest.raises(ConfigError, match="from low to high"):
        convert({"current_mps": [1.0, 0.5]}, HarbourSettings)


def test_a_place_is_inside_a_polygon_that_is_not_convex_where_it_is() -> None:
    horseshoe = np.array([(0, 0), (6, 0), (6, 6), (4, 6), (4, 2), (2, 2), (2, 6), (0, 6)], float)
    places = np.array([(1, 1), (3, 1), (3, 4), (5, 5), (7, 1), (-1, 3)], float)
    assert inside(places, horseshoe).tolist() == [True, True, False, True, False, False]
    assert len(edges_of([horseshoe])) == 8


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(["steady", "shear", "vortex", "tide"]))
def test_no_current_is_faster_than_asked_and_water_neither_appears_nor_vanishes(
    seed: int, kind: str
) -> None:
    kept = convert({"current_mps": [0.4, 0.9], "currents": [kind]}, HarbourSettings)
    field = draw_current(np.random.default_rng(seed), kept, (60.0, 80.0))
    places = np.stack(np.meshgrid(np.arange(0.0, 60.0, 2.0), np.arange(0.0, 80.0, 2.0)), -1)
    places = places.reshape(-1, 2)
    for time_s in (0.0, 37.0, 400.0):
        speed = np.hypot(*field.velocity(places, time_s).T)
        assert speed.max() <= 0.9 + 1e-9
        assert np.isfinite(speed).all()
        if kind in ("steady", "shear"):
            assert speed.max() > 0.1
        step = 1e-4
        north = field.velocity(places + np.array((step, 0.0)), time_s)[:, 0]
        south = field.velocity(places - np.array((step, 0.0)), time_s)[:, 0]
        east = field.velocity(places + np.array((0.0, step)), time_s)[:, 1]
        west = field.velocity(places - np.array((0.0, step)), time_s)[:, 1]
        assert np.abs(north - south + east - west).max() / (2 * step) < 1e-6


def test_many_fields_at_once_are_each_as_alone() -> None:
    kept = convert({"current_mps": [0.4, 0.9], "currents": ["vortex"]}, HarbourSettings)
    fields = [draw_current(np.random.default_rng(k), kept, (60.0, 60.0)) for k in range(5)]
    stacked = CurrentField(*(np.stack(values) for values in zip(*fields, strict=True)))
    places = np.random.default_rng(0).uniform(0.0, 60.0, (5, 7, 2))
    times = np.arange(5.0)
    together = stacked.velocity(places, times)
    for k, field in enumerate(fields):
        assert np.allclose(together[k], field.velocity(places[k], times[k]))


def test_a_sheared_current_flows_faster_to_one_side_and_a_vortex_turns_clockwise() -> None:
    sheared = CurrentField.of((1.0, 0.0), shear=0.5, width=5.0)
    starboard, port = sheared.velocity(np.array([(0.0, 50.0), (0.0, -50.0)]))
    assert np.allclose((starboard[0], port[0]), (1.5, 0.5))
    vortex = CurrentField.of(vortex=[(0.0, 0.0, 3.0, 0.7)])
    at_north = vortex.velocity(np.array([(3.0, 0.0)]))[0]
    assert np.allclose(at_north, (0.0, 0.7))
    tide = CurrentField.of((0.5, 0.0), period=100.0)
    assert np.allclose(tide.velocity(np.zeros((1, 2)), 50.0), [(-0.5, 0.0)])


def test_a_harbour_is_forbidden_where_something_stands() -> None:
    harbour = replace(_draw(0, "open"), piles=np.array([(10.0, 10.0, 1.0)]))
    places = np.array([(10.5, 10.0), (13.0, 10.0)])
    assert harbour.forbidden(places).tolist() == [True, False]
    assert np.allclose(harbour.distance_m(places), (0.0, 2.0))

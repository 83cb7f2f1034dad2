"""Harbours in the training environment: contours, contacts, ways, currents, and warm starts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import torch

from twinscrew.export.run_dir import load_run
from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M, contour_of
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert, shipped
from twinscrew.training.agents import make_agent
from twinscrew.training.commands import train
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.harbours import CurrentField
from twinscrew.training.land import (
    WAY_POINTS,
    crosses_box,
    harbour_of,
    harbour_settings,
)
from twinscrew.training.networks import Beside, unpack, with_risk
from twinscrew.training.physics import current_field, field_columns
from twinscrew.training.settings import load_training

EVERY = ("basin", "channel", "dead_end", "fingers", "gap", "piles", "mixed", "fenced")


def settings(*kinds: str, **more: Any) -> EnvironmentSettings:
    row = {"robots": 3, "harbour": list(kinds)}
    seen = {"extended": True, "contour": True, "observed_objects": 8}
    return convert(
        {"scenarios": [row], "land": {"harbours": 6}, **seen, **more}, EnvironmentSettings
    )


def sailing(env: VectorEnv, decisions: int, seed: int = 0) -> list[Any]:
    """Act at random, mostly ahead; give the results."""
    generator = np.random.default_rng(seed)
    env.reset()
    shape = (env.episodes, env.vessels, 2)
    return [env.step(generator.uniform(-0.3, 0.6, shape)) for _ in range(decisions)]


def test_a_batch_sees_what_each_vessel_alone_would_see() -> None:
    env = VectorEnv(settings("basin", "gap", "fenced"), 6, 1, auto_reset=False)
    env.reset()
    state, land, generator = env.state, env.state.land, np.random.default_rng(0)
    assert land is not None
    for _ in range(12):
        result = env.step(generator.uniform(-0.3, 0.6, (6, 3, 2)))
        for e, v in np.argwhere(result.active):
            ends = np.stack([land.start[e], land.end[e]], axis=-1)
            edges = np.stack([ends.real, ends.imag], axis=-1).astype(np.float64)
            place = np.array([state.position[e, v].real, state.position[e, v].imag])
            alone = contour_of(edges, place, state.heading[e, v])
            together = result.final_observation.contour[e, v]
            # Single precision may put a corner on the ray between two sectors into the other one.
            assert np.mean(np.abs(alone - together) < 1e-2) >= 30 / 32


def test_a_slot_s_harbours_do_not_depend_on_who_sails_beside_it() -> None:
    many = VectorEnv(settings(*EVERY, land={"harbours": 5, "noise_m": 0.1, "lost": 0.1}), 4, 3)
    one = VectorEnv(many.settings, 1, 3, first_slot=2)
    assert np.array_equal(many.reset().rows[2], one.reset().rows[0])
    generator = np.random.default_rng(0)
    for _ in range(20):
        action = generator.uniform(-0.5, 1.0, (4, 3, 2))
        left, right = many.step(action), one.step(action[2:3])
        assert np.array_equal(left.observation.rows[2], right.observation.rows[0])
        assert np.array_equal(left.collided[2], right.collided[0])


def test_a_wall_ends_the_episode_of_whom_it_stops_and_says_what_it_was() -> None:
    for kind, touched in (("channel", "touched_land"), ("fenced", "touched_fence")):
        env = VectorEnv(settings(kind), 8, 0, auto_reset=False)
        env.reset()
        found, other = 0, 0
        for _ in range(120):
            result = env.step(np.full((8, 3, 2), 1.0))  # straight ahead: sooner or later a wall
            hit = getattr(result, touched)
            assert (result.terminated[hit]).all()
            assert not result.reached[hit].any()
            found += int(hit.sum())
            other += int((result.touched_land | result.touched_fence)[~hit].sum())
        assert found > 8
        assert other == 0


def test_a_box_touches_what_has_a_point_in_it() -> None:
    generator = np.random.default_rng(0)
    start, end = generator.uniform(-3.0, 3.0, (2, 3000, 2)) @ np.array([1, 1j])
    half = np.array([2.0, 1.0])
    along = start[:, None] + np.linspace(0, 1, 2001) * (end - start)[:, None]
    inside = ((np.abs(along.real) <= 2.0) & (np.abs(along.imag) <= 1.0)).any(axis=1)
    found = crosses_box(start, end, half)
    assert (found >= inside).all()
    assert np.mean(found != inside) < 0.002


def test_a_narrow_gap_can_be_passed_by_the_rectangle_though_not_by_the_circle() -> None:
    env = VectorEnv(settings("gap"), 1, 0, auto_reset=False)
    env.reset()
    land, state = env.state.land, env.state
    assert land is not None
    corners = np.array([[-20 + 2j, 20 + 2j], [-20 - 2j, 20 - 2j]])  # 4 m: 1.6 beams
    land.start[:], land.end[:] = 1e6, 1e6
    land.start[0, :2], land.end[0, :2] = corners[:, 0], corners[:, 1]
    state.active[:] = [[True, False, False]]
    state.north_east[:, 0, 0], state.heading[0, 0] = (0.0, 0.0), 0.0
    state.position[0, 0] = 0.0
    assert not env.step(np.full((1, 3, 2), 0.2)).collided.any()
    state.heading[0, 0] = 0.6
    assert env.step(np.zeros((1, 3, 2))).touched_land[0, 0]


def test_no_edge_lies_between_a_vessel_on_its_way_and_the_goal_that_is_shown() -> None:
    env = VectorEnv(settings(*EVERY), 12, 2, auto_reset=False)
    env.reset()
    land, state, every = env.state.land, env.state, np.arange(12)
    assert land is not None
    for point in range(WAY_POINTS):
        state.position[:] = land.way[..., point]
        for _ in range(2):  # it is looked for at every other decision
            state.active[:] = True
            state.take_aim(every)
        sight = land.shown - state.position
        start = (land.start[:, None] - state.position[..., None]) / sight[..., None]
        end = (land.end[:, None] - state.position[..., None]) / sight[..., None]
        # In units of the sight, which so reaches from 0 to 1 along the first axis.
        rise = np.where(start.imag == end.imag, 1.0, end.imag - start.imag)
        where = start.real - start.imag * (end.real - start.real) / rise
        crossed = (start.imag > 0) != (end.imag > 0)
        between = crossed & (where > 1e-3) & (where < 1.0 - 1e-3)
        assert not between[np.abs(sight) > 0.1].any()


def test_the_way_that_is_left_falls_to_nothing_along_it() -> None:
    env = VectorEnv(settings("channel", "basin"), 8, 2, auto_reset=False)
    env.reset()
    land, state, every = env.state.land, env.state, np.arange(8)
    assert land is not None
    whole = land.rest[..., 0]
    assert (state.way_left <= whole + 1e-3).all()
    for point in range(WAY_POINTS):
        state.position[:] = land.way[..., point]
        for _ in range(2):
            state.active[:] = True
            state.take_aim(every)
        # The points of a way are some metres apart: what is shown may cut, or add, one such piece.
        piece = whole / (WAY_POINTS - 1)
        assert (state.way_left <= land.rest[..., point] + 0.5 * piece).all()
    assert np.allclose(state.way_left, 0.0, atol=1e-3)


def test_a_vessel_behind_a_wall_is_not_shown_its_goal_through_it() -> None:
    env = VectorEnv(settings("channel"), 1, 0, auto_reset=False)
    env.reset()
    land, state = env.state.land, env.state
    assert land is not None
    land.way[0, 0] = np.linspace(0.0, 60.0, WAY_POINTS)
    land.rest[0, 0] = np.linspace(60.0, 0.0, WAY_POINTS)
    wall = np.array([[30.0 - 50.0j], [30.0 + 50.0j]])
    one = harbour_of(harbour_settings(("channel",), 3, (5.0, 2.5), land.settings), 0, 0)
    walled = one._replace(
        start=wall[0].astype(np.complex64),
        end=wall[1].astype(np.complex64),
        fence=np.zeros(1, bool),
        way=land.way[0].copy(),
        rest=land.rest[0].copy(),
    )
    land.begin(np.array([0]), [walled], np.full((1, 4, 16), 0.99))
    state.position[:] = 5.0 + 3.0j
    state.take_aim(np.array([0]))
    assert 20.0 < land.shown[0, 0].real < 30.0
    assert land.beyond[0, 0] == pytest.approx(60.0 - land.shown[0, 0].real, abs=1e-3)


def test_open_water_has_no_edges_and_its_episodes_are_the_same_as_without_a_contour() -> None:
    row = {"robots": 3, "min_distance_m": 30.0}
    seen = {"scenarios": [row], "extended": True, "observed_objects": 8}
    plain = VectorEnv(convert(seen, EnvironmentSettings), 4, 5)
    with_contour = VectorEnv(convert({**seen, "contour": True}, EnvironmentSettings), 4, 5)
    generator = np.random.default_rng(0)
    left, right = plain.reset(), with_contour.reset()
    for _ in range(30):
        assert np.array_equal(left.rows, right.rows[..., : left.rows.shape[-1]])
        action = generator.uniform(-0.5, 1.0, (4, 3, 2))
        left, right = plain.step(action).observation, with_contour.step(action).observation
        sailing_now = with_contour.active
        assert (right.contour[sailing_now] == CONTOUR_RANGE_M).all()


def test_currents_carry_vessels_as_the_field_says_and_keep_their_way_over_ground() -> None:
    conditions = {"currents": ["vortex"], "current_mps": [1.0, 1.0]}
    row = {"robots": 2, "min_distance_m": 20.0}
    made = convert({"scenarios": [row], "conditions": conditions}, EnvironmentSettings)
    env = VectorEnv(made, 5, 0, auto_reset=False)
    env.reset()
    state = env.state
    assert np.abs(state.drift[state.active]).max() > 0.1
    for _ in range(40):
        before, velocity = state.position.copy(), state.velocity.copy()
        env.step(np.zeros((5, 2, 2)))
        going = state.active
        moved = (state.position - before)[going]
        assert np.allclose(moved, 0.5 * velocity[going], atol=0.08)


def test_a_field_survives_being_a_row_of_numbers() -> None:
    field = CurrentField.of((0.3, 0.4), centre=(2, 3), shear=0.5, width=9, period=60, phase=1)
    turning = CurrentField.of((0.1, 0.0), vortex=[(4, 5, 6, 0.7)])
    places = np.random.default_rng(0).uniform(-20, 20, (7, 2))
    for one in (field, turning):
        again = current_field(field_columns(one))
        assert np.allclose(again.velocity(places, 12.0), one.velocity(places, 12.0))


@pytest.fixture(scope="module")
def agents() -> tuple[Any, Any]:
    """Give an agent without a contour, and one with, that began from it."""
    told = load_training(shipped("training", "ac_iqn_edges")).agent
    blind = msgspec.structs.replace(
        told, network=msgspec.structs.replace(told.network, contour=False)
    )
    old, new = make_agent(blind, 1), make_agent(told, 2)
    new.start_from(old.state())
    return old, new


def observed() -> torch.Tensor:
    env = VectorEnv(settings(*EVERY), 4, 0)
    return torch.from_numpy(np.concatenate([r.observation.rows for r in sailing(env, 8)]))


def test_what_knew_no_edges_goes_on_bit_for_bit(agents: tuple[Any, Any]) -> None:
    old, new = agents
    seen = unpack(observed().flatten(0, 1))
    assert (seen.contour < CONTOUR_RANGE_M).float().mean() > 0.2
    with torch.no_grad():
        assert torch.equal(old.deployed(1.25)(seen), new.deployed(1.25)(seen))


def test_another_run_s_networks_are_refused_by_name(agents: tuple[Any, Any]) -> None:
    _, new = agents
    narrow = msgspec.structs.replace(
        new.settings, network=msgspec.structs.replace(new.settings.network, hidden_width=64)
    )
    with pytest.raises(ConfigError, match="has shape"):
        make_agent(narrow, 0).start_from(new.state())


def test_who_acts_beside_edges_leaves_open_water_alone(agents: tuple[Any, Any]) -> None:
    old, _ = agents
    other = make_agent(agents[1].settings, 7)
    level = torch.full((1, 1), 0.5)
    both = Beside(old.networks["average_actor"], other.networks["average_actor"])
    rows = observed().flatten(0, 1)
    seen = unpack(rows)
    nothing = seen._replace(contour=torch.full_like(seen.contour, CONTOUR_RANGE_M))
    with torch.no_grad():
        open_water = with_risk(other.see(nothing), level)
        assert torch.equal(both(open_water), old.networks["average_actor"](open_water))
        near = with_risk(other.see(seen), level)
        beside = near.near[:, 0] == 1.0
        assert beside.any()
        assert torch.allclose(both(near)[beside], other.networks["average_actor"](near)[beside])


@pytest.mark.slow
def test_a_run_begins_from_another_s_checkpoint(tmp_path: Path) -> None:
    small = [
        *("parallel_episodes=4", "warm_up=10", "replay=500", "batch=8", "evaluation_episodes=1"),
        *("agent.precision=float32", "updates_per_step=0.5", "rough_share=0.0"),
    ]
    train("ac_iqn_general", steps=2, out=tmp_path / "first", changes=small)
    begun = tmp_path / "first/seed_0/checkpoint.pt"
    train("ac_iqn_edges", steps=2, out=tmp_path / "second", changes=small, start=begun)
    assert '"begun_from"' in (tmp_path / "second/seed_0/log.jsonl").read_text()
    pilot, _, trained = load_run(tmp_path / "second/seed_0", open_water=tmp_path / "first/seed_0")
    assert trained["open_water"]["checkpoint"]["step"] == 2
    first, _, _ = load_run(tmp_path / "first/seed_0", "checkpoint.pt", risk=0.375)
    open_water = unpack(observed().flatten(0, 1))
    nothing = torch.full_like(open_water.contour, CONTOUR_RANGE_M)
    seen = open_water._replace(contour=nothing)
    with torch.no_grad():
        assert torch.equal(pilot(seen, torch.tensor([[0.375]])), first(seen))

"""Equilibrium on still water."""

import dataclasses

import numpy as np
import pytest
from msgspec.structs import replace
from tests.reference.sailing import calm, centred_vessel, euler, sail

from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest, equilibrium
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel_description import load_vessel

DYNAMICS = VesselDynamics(load_vessel())


def resting(count: int = 1):
    return at_rest(DYNAMICS, np.zeros((count, 2)), np.zeros(count))


def test_lift_equals_weight_at_the_draught():
    vessel = centred_vessel()
    down, pitch = equilibrium(VesselDynamics(vessel))
    r, b = vessel.buoyancy.hull_radius_m, vessel.buoyancy
    area = r * r * np.arccos((r - down) / r) - (r - down) * np.sqrt(2 * r * down - down**2)
    volume = 2 * b.hull_length_m * area
    assert volume * b.water_density_kgpm3 == pytest.approx(280.0, rel=1e-9)
    assert pitch == pytest.approx(0.0, abs=1e-9)


def test_the_wam_v_floats_by_the_head_because_its_weight_is_ahead_of_its_lift():
    down, pitch = equilibrium(DYNAMICS)
    assert 0.0 < down < load_vessel().buoyancy.hull_radius_m
    assert -0.05 < pitch < 0.0


def test_a_resting_vessel_stays_where_it_is():
    end = sail(DYNAMICS, resting(), (0, 0), calm(), 20)[-1]
    np.testing.assert_allclose(end.position_N, resting().position_N, atol=1e-9)
    np.testing.assert_allclose(end.q_NB, resting().q_NB, atol=1e-9)


def test_a_lifted_rolled_and_pitched_vessel_settles_back():
    rest = resting(2)
    tilt = np.array([[np.cos(0.1), np.sin(0.1), 0, 0], [np.cos(0.05), 0, np.sin(0.05), 0]])
    moved = dataclasses.replace(rest, position_N=rest.position_N - [0, 0, 0.05], q_NB=tilt)
    end = sail(DYNAMICS, moved, (0, 0), calm(), 30)[-1]
    np.testing.assert_allclose(end.position_N[:, 2], rest.position_N[:, 2], atol=1e-5)
    np.testing.assert_allclose(euler(end)[:, :2], euler(rest)[:, :2], atol=1e-5)


def test_what_cannot_float_upright_is_refused():
    vessel = load_vessel()
    heavy = tuple(replace(part, mass_kg=4 * part.mass_kg) for part in vessel.parts)
    with pytest.raises(ConfigError, match="equilibrium"):
        equilibrium(VesselDynamics(dataclasses.replace(vessel, parts=heavy)))

"""The fast layout against the readable model."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.training.physics import Coefficients, ConditionSettings, Forces, Motion, physical

OTHER = VesselParameters(mass_kg=296.0, izz=600.0, x_udot=0.0, n_rdot=0.0, n_r=-800.0, width=2.054)


@pytest.mark.parametrize("parameters", [VesselParameters(), OTHER])
def test_ten_sub_steps_equal_ten_steps_of_the_vessel_model(parameters: VesselParameters) -> None:
    generator = np.random.default_rng(1)
    pose, nu = generator.normal(size=(6, 3)), generator.normal(size=(6, 3))
    thrust = generator.uniform(-500, 1000, (6, 2))
    model = VesselModel(parameters)
    position, heading, velocity = pose.T[:2].copy(), pose.T[2].copy(), nu.T.copy()
    dynamics = Motion(Coefficients(parameters, 0.05), 6, 10)
    forces = SimpleNamespace(next=lambda _: model.force(thrust).T)
    dynamics.advance(position, heading, velocity, forces)
    for substep in range(1, 11):
        pose, nu = model.step(pose, nu, thrust, 0.05)
        np.testing.assert_allclose(dynamics.trajectory[substep], pose.T[:2], atol=1e-12)
    np.testing.assert_allclose(heading, pose.T[2], atol=1e-12)
    np.testing.assert_allclose(velocity, nu.T, atol=1e-12)


def test_vessels_with_their_own_hulls_each_move_as_their_own_model() -> None:
    coefficients = Coefficients(VesselParameters(), 0.05, 2)
    coefficients.assign(np.array([1]), np.array(physical(OTHER))[:, None])
    thrust = np.array([[300.0, 100.0]])
    position, heading, nu = np.zeros((2, 2)), np.zeros(2), np.zeros((3, 2))
    tau = np.stack([VesselModel(p).force(thrust)[0] for p in (VesselParameters(), OTHER)], axis=1)
    Motion(coefficients, 2, 1).advance(position, heading, nu, SimpleNamespace(next=lambda _: tau))
    for k, parameters in enumerate((VesselParameters(), OTHER)):
        _, alone = VesselModel(parameters).step(np.zeros(3), np.zeros(3), thrust[0], 0.05)
        np.testing.assert_allclose(nu[:, k], alone, atol=1e-15)


def test_drawn_hulls_lie_between_the_two_and_differ() -> None:
    settings = ConditionSettings(other_vessel=OTHER)
    conditions = Forces(settings, VesselParameters(), (3, 4), 0.05)
    conditions.begin(np.arange(3), np.random.default_rng(0).random((3, 5, 16)))
    surge = 0.05 / conditions.coefficients.gain[0]
    assert surge.min() >= 296.0
    assert surge.max() <= 380.0
    assert len(np.unique(surge)) == 12
    assert (
        (conditions.coefficients.lever >= 1.027) & (conditions.coefficients.lever <= 1.25)
    ).all()


def test_the_wind_presses_with_the_force_of_the_simulator() -> None:
    """At rest, from the side and from ahead: 0.5 V |V| (parameters.md, Wind)."""
    settings = ConditionSettings(wind_mps=(10.0, 10.0))
    conditions = Forces(settings, VesselParameters(), (1, 1), 0.05)
    conditions.begin(np.arange(1), np.zeros((1, 2, 16)))  # blows to the north
    calm, there = np.zeros((2, 1, 1)), np.ones((1, 1), bool)
    for heading, expected in [(0.0, [50.0, 0, 0]), (np.pi / 2, [0, -50.0, 0])]:
        conditions.decide(calm, np.full((1, 1), heading), there, np.zeros(1))
        np.testing.assert_allclose(conditions.next(np.zeros((3, 1)))[:, 0], expected, atol=1e-12)
    conditions.decide(calm, np.full((1, 1), -np.pi / 4), there, np.zeros(1))
    force = conditions.next(np.zeros((3, 1)))[:, 0]
    np.testing.assert_allclose(force, [25.0, 25.0, -2 * 0.33 * 50.0])


def test_forces_leave_vessels_alone_that_are_not_on_the_water() -> None:
    settings = ConditionSettings(wind_mps=(10.0, 10.0), wave_force_n=(50.0, 50.0))
    conditions = Forces(settings, VesselParameters(), (1, 2), 0.05)
    conditions.begin(np.arange(1), np.full((1, 3, 16), 0.3))
    there = np.array([[True, False]])
    conditions.decide(np.zeros((2, 1, 2)), np.zeros((1, 2)), there, np.zeros(1))
    force = conditions.next(np.zeros((3, 2)))
    assert force[:, 0].any()
    assert not force[:, 1].any()


def test_with_coriolis_twice_a_turning_boat_slides_outward() -> None:
    """The velocity is kept in the world frame while the hull turns, and C(nu) nu subtracted too."""
    ends = {}
    for coriolis in ("once", "twice"):
        for right in (600.0, 800.0):
            motion = Motion(Coefficients(VesselParameters(), 0.05, 1, coriolis), 1, 200)
            force = VesselModel().force(np.array([[800.0, right]])).T
            nu = np.zeros((3, 1))
            motion.advance(
                np.zeros((2, 1)), np.zeros(1), nu, SimpleNamespace(next=lambda _, f=force: f)
            )
            ends[coriolis, right] = nu[:, 0]
    assert np.array_equal(ends["once", 800.0], ends["twice", 800.0])
    assert ends["once", 600.0][2] > 0.1  # turns to starboard, so outward is to port
    assert ends["twice", 600.0][1] < ends["once", 600.0][1] < 0.0


def test_one_sub_step_with_coriolis_twice_turns_the_velocity_back_by_the_hulls_turn() -> None:
    nu = np.array([[2.0], [0.5], [0.4]])
    free = VesselParameters(x_u=0.0, y_v=0.0, n_r=0.0, x_uu=0.0, y_vv=0.0, n_rr=0.0)
    moved = {}
    for coriolis in ("once", "twice"):
        after = nu.copy()
        still = SimpleNamespace(next=lambda _: np.zeros((3, 1)))
        motion = Motion(Coefficients(free, 0.05, 1, coriolis), 1, 1)
        motion.advance(np.zeros((2, 1)), np.zeros(1), after, still)
        moved[coriolis] = after
    expected = [0.05 * 0.5 * 0.4, -0.05 * 2.0 * 0.4, 0.0]  # v r dt, -u r dt
    np.testing.assert_allclose((moved["twice"] - moved["once"])[:, 0], expected, atol=1e-12)

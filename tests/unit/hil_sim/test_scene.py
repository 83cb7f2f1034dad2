from __future__ import annotations

import dataclasses

import numpy as np

from twinscrew.hil_sim import scene
from twinscrew.hil_sim.bodies import ABSENT
from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.geometry import quaternion_from_euler, rotation_from_quaternion
from twinscrew.runtime.vessel_description import load_vessel

ATTITUDES = np.array(
    [quaternion_from_euler(0.1, -0.2, 2.5), quaternion_from_euler(-0.3, 0.4, -1.0)]
)


def test_attitudes_become_rotations_as_one_by_one() -> None:
    one_by_one = np.array([rotation_from_quaternion(q) for q in ATTITUDES])
    np.testing.assert_allclose(scene.rotations(ATTITUDES), one_by_one, atol=1e-15)


def test_bodies_are_vessels_then_buoys_then_all_quays() -> None:
    scenario = dataclasses.replace(
        load_scenario("head_on"),
        buoys=np.array([[20.0, 30.0, 0.75]]),
        quays=np.array([[0.0, 10.0, 30.0, 4.0, 1.5, 0.2], [9.0, 0.0, 3.0, 3.0, 1.0, 0.0]]),
    )
    state = VesselState(
        position_N=np.array([[1.0, 2.0, 0.1], [3.0, 4.0, 0.2]]),
        q_NB=ATTITUDES,
        velocity_B=np.array([[2.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        rates_B=np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.0]]),
        thrust=np.zeros((2, 2)),
    )
    sea = Sea(SeaSettings(), np.random.default_rng(0))
    found = scene.bodies(scenario, state, np.array([scene.VESSEL, ABSENT]), sea, 9.0)
    assert found.shape.tolist() == [scene.VESSEL, ABSENT, scene.BUOY, scene.QUAYS]
    np.testing.assert_array_equal(found.position_N[:2], state.position_N)
    np.testing.assert_array_equal(found.position_N[3], np.zeros(3))
    np.testing.assert_allclose(found.water_z[0], -sea.elevation(state.position_N[0, :2], 9.0))
    np.testing.assert_allclose(found.position_N[2, 2], -sea.elevation(np.array([20.0, 30.0]), 9.0))
    assert found.velocity_N is not None
    np.testing.assert_allclose(found.velocity_N[0], found.R_NB[0] @ [2.0, 0.0, 0.0])
    assert (found.velocity_N[2:] == 0).all()


def test_a_quay_stands_in_the_water_and_rises_by_its_height() -> None:
    scenario = dataclasses.replace(
        load_scenario("head_on"), quays=np.array([[5.0, 10.0, 30.0, 4.0, 1.5, 0.0]])
    )
    quay = scene.shapes(scenario, [load_vessel()])[scene.QUAYS]
    low, high = quay.centres[0] - quay.halves[0], quay.centres[0] + quay.halves[0]
    np.testing.assert_allclose(low, [-10.0, 8.0, -1.5])
    np.testing.assert_allclose(high, [20.0, 12.0, scene.QUAY_DRAUGHT])


def test_a_scenario_without_quays_has_no_shape_for_them() -> None:
    assert len(scene.shapes(load_scenario("head_on"), [load_vessel()])) == 2

"""What must hold for every vessel, state and sea: parity, symmetries, conservation, convergence."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples
from tests.reference import energy, vessel_step
from tests.reference.sailing import NO_WAVES, calm, paper_sea, sail

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import DynamicsSettings, VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.vessel_description import load_vessel

WAM_V = load_vessel()
DYNAMICS = VesselDynamics(WAM_V)
NO_AIR = replace(WAM_V, windage=replace(WAM_V.windage, along=0.0, across=0.0, yaw=0.0))
ZEROS = (0.0,) * 6

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=examples(25), deadline=None)


def random_state(seed: int, count: int = 4, tilt: float = 0.3) -> VesselState:
    """Vessels afloat anywhere, with every velocity, rolled and pitched by about `tilt` [rad]."""
    rng = np.random.default_rng(seed)
    heading = rng.uniform(-np.pi, np.pi, count)
    level = np.column_stack([np.cos(heading / 2), *np.zeros((2, count)), np.sin(heading / 2)])
    tilts = np.column_stack([rng.normal(0, tilt, (count, 2)), np.zeros(count)])
    return VesselState(
        position_N=rng.uniform([-50, -50, 0.0], [50, 50, 0.2], (count, 3)),
        q_NB=vessel_step.turn(level, tilts),
        velocity_B=rng.normal(0, [2.0, 0.7, 0.3], (count, 3)),
        rates_B=rng.normal(0, 0.5, (count, 3)),
        thrust=rng.uniform(-500, 1000, (count, 2)),
    )


def random_sea(seed: int) -> Sea:
    rng = np.random.default_rng(seed)
    return Sea(
        SeaSettings(
            waves=WaveSettings(towards_deg=rng.uniform(0, 360), random_phase=True),
            wind=WindSettings(mean_mps=rng.uniform(0, 15), from_deg=rng.uniform(0, 360)),
            current_mps=tuple(rng.normal(0, 0.5, 2)),
        ),
        rng,
    )


def assert_same(one: VesselState, two: VesselState, atol: float) -> None:
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(two, field.name)
        np.testing.assert_allclose(a, b, atol=atol, rtol=0, err_msg=field.name)


@few
@given(seeds, st.sampled_from([0.01, 0.05]), st.sampled_from([0.0, 0.4]), st.booleans())
def test_the_native_step_equals_the_numpy_reference(seed, dt, lag_s, world_frame):
    frame = "vrx_world_frame" if world_frame else "body"
    native = VesselDynamics(WAM_V, DynamicsSettings(wind_frame=frame, thrust_lag_s=lag_s))
    one = two = random_state(seed)
    sea, rng = random_sea(seed), np.random.default_rng(seed)
    for i in range(20):
        command = rng.uniform(-800, 1300, (4, 2))
        one = native.step(one, command, sea, i * dt, dt)
        two = vessel_step.step(
            WAM_V, two, command, sea, i * dt, dt, lag_s=lag_s, world_frame=world_frame
        )
    assert_same(one, two, atol=1e-9)


@few
@given(seeds)
def test_the_native_acceleration_equals_the_numpy_reference(seed):
    state, sea = random_state(seed), random_sea(seed)
    expected = vessel_step.acceleration(WAM_V, state, sea, 7.0, world_frame=False)
    np.testing.assert_allclose(DYNAMICS.acceleration(state, sea, 7.0), expected, atol=1e-10)


@few
@given(seeds)
def test_attitudes_stay_unit_quaternions(seed):
    end = sail(DYNAMICS, random_state(seed), (700, -200), random_sea(seed), 5)[-1]
    np.testing.assert_allclose(np.linalg.norm(end.q_NB, axis=1), 1.0, atol=1e-14)


@few
@given(seeds)
def test_a_mirrored_vessel_makes_the_mirrored_voyage(seed):
    state = random_state(seed)
    one = sail(DYNAMICS, state, (900, 100), calm(), 3)[-1]
    two = sail(DYNAMICS, mirrored(state), (100, 900), calm(), 3)[-1]
    assert_same(mirrored(one), two, atol=1e-8)


def mirrored(state: VesselState) -> VesselState:
    """Port for starboard: polar vectors keep x and z, axial vectors keep y."""
    return VesselState(
        position_N=state.position_N * [1, -1, 1],
        q_NB=state.q_NB * [1, -1, 1, -1],
        velocity_B=state.velocity_B * [1, -1, 1],
        rates_B=state.rates_B * [-1, 1, -1],
        thrust=state.thrust[:, ::-1].copy(),
    )


@few
@given(seeds, st.floats(-3, 3), st.floats(-100, 100), st.floats(-100, 100))
def test_still_water_is_the_same_everywhere_and_in_every_direction(seed, turn, north, east):
    state = random_state(seed)
    here = sail(DYNAMICS, state, (500, 200), calm(), 3)[-1]
    there = sail(DYNAMICS, moved(state, turn, north, east), (500, 200), calm(), 3)[-1]
    assert_same(moved(here, turn, north, east), there, atol=1e-8)


def moved(state: VesselState, turn: float, north: float, east: float) -> VesselState:
    c, s = np.cos(turn), np.sin(turn)
    x, y, z = state.position_N.T
    half = np.array([np.cos(turn / 2), 0, 0, np.sin(turn / 2)])
    w, qx, qy, qz = state.q_NB.T
    turned = [
        half[0] * w - half[3] * qz,
        half[0] * qx - half[3] * qy,
        half[0] * qy + half[3] * qx,
        half[0] * qz + half[3] * w,
    ]
    position = np.column_stack([c * x - s * y + north, s * x + c * y + east, z])
    return dataclasses.replace(state, position_N=position, q_NB=np.column_stack(turned))


@few
@given(seeds, st.floats(-1, 1), st.floats(-1, 1))
def test_a_steady_current_carries_the_same_voyage_along(seed, north, east):
    # Air that moves with the water, so that nothing can tell the difference.
    drift = np.array([north, east, 0.0])
    state, sea = random_state(seed), calm((north, east))
    sea.wind = lambda _t: drift[:2].copy()
    carried = shifted(state, drift, 0.0)
    still = sail(DYNAMICS, state, (500, 200), calm(), 3)[-1]
    afloat = sail(DYNAMICS, carried, (500, 200), sea, 3)[-1]
    assert_same(shifted(still, drift, 3.0), afloat, atol=1e-8)


def shifted(state: VesselState, drift: np.ndarray, seconds: float) -> VesselState:
    drift_B = np.einsum("vij,i->vj", vessel_step.rotation(state.q_NB), drift)
    return dataclasses.replace(
        state,
        position_N=state.position_N + seconds * drift,
        velocity_B=state.velocity_B + drift_B,
    )


def total_energy(vessel, state):
    return energy.kinetic(vessel, state) + energy.potential(vessel, state)


@pytest.mark.slow
@few
@given(seeds)
def test_on_still_water_without_thrust_energy_only_decreases(seed):
    # Within a swing the step makes some energy appear and vanish: O(dt), under 1 % at 1 ms.
    dynamics = VesselDynamics(NO_AIR)
    states = sail(dynamics, random_state(seed, 1, tilt=0.05), (0, 0), calm(), 4, dt_s=0.001)[::40]
    rest = total_energy(NO_AIR, at_rest(dynamics, np.zeros((1, 2)), np.zeros(1)))[0]
    left = np.array([total_energy(NO_AIR, state)[0] - rest for state in states])
    assert left.min() > -1e-6
    assert np.max(left[1:] - np.minimum.accumulate(left)[:-1]) < 0.01 * left[0]
    assert left[-1] < 0.5 * left[0]


@pytest.mark.slow
@few
@given(seeds)
def test_without_drag_energy_is_kept_to_the_order_of_the_step(seed):
    vessel = replace(NO_AIR, linear_drag=ZEROS, quadratic_drag=ZEROS)
    dynamics, state = VesselDynamics(vessel), random_state(seed, 1, tilt=0.05)
    before = total_energy(vessel, state)
    coarse, fine = (
        total_energy(vessel, sail(dynamics, state, (0, 0), calm(), 2, dt_s=dt)[-1]) - before
        for dt in (0.001, 0.0005)
    )
    scale = energy.kinetic(vessel, state) + 100.0  # [J] a rolled vessel at rest has some, too
    np.testing.assert_array_less(np.abs(fine), 0.01 * scale)
    # The error of first order cancels here, and nothing else is left.
    np.testing.assert_array_less(np.abs(2 * fine - coarse), 5e-4 * scale)


def in_nothing():
    """The WAM-V without weight, water, drag and air: only inertia is left."""
    nearly_none = 1e-12
    buoyancy = replace(WAM_V.buoyancy, gravity_mps2=nearly_none, water_density_kgpm3=nearly_none)
    return replace(NO_AIR, linear_drag=ZEROS, quadratic_drag=ZEROS, buoyancy=buoyancy)


@pytest.mark.slow
@few
@given(seeds)
def test_without_any_force_momentum_is_kept_to_the_order_of_the_step(seed):
    vessel = replace(in_nothing(), added_mass=ZEROS)
    dynamics, state = VesselDynamics(vessel), random_state(seed)
    p0, L0 = energy.momentum(vessel, state)
    errors = []
    for dt in (0.002, 0.001):
        p, L = energy.momentum(vessel, sail(dynamics, state, (0, 0), calm(), 2, dt_s=dt)[-1])
        errors.append([np.linalg.norm(p - p0), np.linalg.norm(L - L0)])
    coarse, fine = np.array(errors)
    np.testing.assert_array_less(fine, 0.005 * np.array([np.linalg.norm(p0), np.linalg.norm(L0)]))
    np.testing.assert_allclose(coarse / fine, 2.0, rtol=0.1)


@pytest.mark.slow
def test_halving_the_step_halves_the_error():
    # Semi-implicit Euler is of first order. In the paper's sea, turning hard, 10 s.
    def end(dt_s):
        start = at_rest(DYNAMICS, np.zeros((1, 2)), np.zeros(1))
        return sail(DYNAMICS, start, (800, -200), paper_sea(), 10, dt_s=dt_s)[-1]

    exact = end(0.0003125)
    steps = np.array([0.02, 0.01, 0.005])
    states = [end(dt) for dt in steps]
    for field in ("position_N", "q_NB", "velocity_B", "rates_B"):
        errors = [np.linalg.norm(getattr(s, field) - getattr(exact, field)) for s in states]
        order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
        assert order == pytest.approx(1.0, abs=0.12), field


def test_the_default_step_is_exact_to_two_centimetres_in_ten_seconds():
    start = at_rest(DYNAMICS, np.zeros((1, 2)), np.zeros(1))
    ends = [
        sail(DYNAMICS, start, (800, -200), paper_sea(), 10, dt_s=dt)[-1] for dt in (0.01, 0.001)
    ]
    assert np.linalg.norm(ends[0].position_N - ends[1].position_N) < 0.02


@pytest.mark.parametrize("current", [(0.5, -0.2)])
def test_without_wind_and_thrust_a_vessel_ends_up_drifting_with_the_current(current):
    sea = Sea(
        SeaSettings(waves=NO_WAVES, wind=WindSettings(mean_mps=0.0), current_mps=current),
        np.random.default_rng(0),
    )
    dynamics = VesselDynamics(NO_AIR)
    start = at_rest(dynamics, np.zeros((1, 2)), np.array([1.0]))
    end = sail(dynamics, start, (0, 0), sea, 120)[-1]
    R = vessel_step.rotation(end.q_NB)[0]
    np.testing.assert_allclose((R @ end.velocity_B[0])[:2], current, atol=1e-3)

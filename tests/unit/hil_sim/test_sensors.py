"""The simulated GPS and IMU: true but for biases and noise, of which they tell; at their rates."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace as with_settings
from tests.harness.circling import DT_S, EPOCH_NS, EXACT_IMU, FRAME, VRX_PLACE, truth

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.navigation import (
    ImuSettings,
    Navigation,
    ReceiverSettings,
    SimulatedImu,
    SimulatedReceiver,
    Triad,
    TriadSettings,
)
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.datum import Place
from twinscrew.runtime.estimation.sensors import SensorSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.perception.sensor import Mount

VRX_GYRO = ImuSettings().gyro


def at_rest(heading: float = 0.0) -> VesselState:
    state = truth(heading / 0.3)
    return replace(state, velocity_B=np.zeros((1, 3)), rates_B=np.zeros((1, 3)))


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_triads_noise_is_white_about_its_bias() -> None:
    triad = Triad(VRX_GYRO, rng())
    told = np.array([triad.measure(np.array([1.0, 2.0, 3.0]), 0.01) for _ in range(4000)])
    np.testing.assert_allclose(told.mean(axis=0) - [1, 2, 3], triad.bias, atol=5e-4)
    np.testing.assert_allclose(told.std(axis=0), VRX_GYRO.sigma, rtol=0.05)
    neighbours = np.corrcoef(told[1:, 0], told[:-1, 0])[0, 1]
    assert abs(neighbours) < 0.06


def test_biases_have_vrxs_mean_and_spread_with_either_sign() -> None:
    force = ImuSettings().force
    biases = np.concatenate([Triad(force, rng(seed)).bias for seed in range(400)])
    assert np.abs(biases).mean() == pytest.approx(0.05, abs=0.002)
    assert np.abs(biases).std() == pytest.approx(0.0075, rel=0.1)
    assert abs(np.sign(biases).mean()) < 0.1


def test_a_bias_that_wanders_keeps_its_spread() -> None:
    settings = TriadSettings(
        sigma=0.0, bias_mean=0.0, bias_sigma=0.0, wander_sigma=0.2, wander_time_s=1.0
    )
    triad = Triad(settings, rng())
    told = np.array([triad.measure(np.zeros(3), 0.1) for _ in range(8000)])
    assert told[100:].std() == pytest.approx(0.2, rel=0.1)
    assert np.corrcoef(told[1:, 0], told[:-1, 0])[0, 1] == pytest.approx(np.exp(-0.1), abs=0.03)


def test_a_unit_on_a_boat_at_rest_feels_gravity_only() -> None:
    state = truth(0.0)
    state = replace(state, velocity_B=np.zeros((1, 3)), rates_B=np.zeros((1, 3)))
    state = replace(state, q_NB=np.array([[1.0, 0.0, 0.0, 0.0]]))
    imu = SimulatedImu(EXACT_IMU, VRX_PLACE, state, 0, rng())
    sample = imu.sense(state, EPOCH_NS, DT_S)
    np.testing.assert_allclose(sample.force_I, (0.0, 0.0, -9.81), atol=1e-12)
    np.testing.assert_array_equal(sample.rates_I, 0.0)


def test_a_unit_far_from_the_middle_of_a_turn_feels_the_centripetal_force() -> None:
    """On the spot, turning by w: w^2 x inwards, at x ahead of the axis."""
    place = SensorSettings(imu=Mount(x_m=2.0, y_m=0.0, z_m=0.0))
    states = []
    for k in range(2):
        half = 0.5 * 0.8 * DT_S * k
        states.append(
            replace(
                truth(0.0),
                q_NB=np.array([[np.cos(half), 0.0, 0.0, np.sin(half)]]),
                velocity_B=np.zeros((1, 3)),
                rates_B=np.array([[0.0, 0.0, 0.8]]),
            )
        )
    imu = SimulatedImu(EXACT_IMU, place, states[0], 0, rng())
    sample = imu.sense(states[1], EPOCH_NS, DT_S)
    np.testing.assert_allclose(sample.force_I, (-(0.8**2) * 2.0, 0.0, -9.81), atol=0.01)


def test_a_unit_that_is_turned_feels_in_its_own_axes() -> None:
    place = SensorSettings(imu=Mount(x_m=0.0, y_m=0.0, z_m=0.0, yaw_rad=np.pi / 2))
    state = replace(truth(0.0), rates_B=np.array([[0.1, 0.2, 0.3]]))
    sample = SimulatedImu(EXACT_IMU, place, state, 0, rng()).sense(state, EPOCH_NS, DT_S)
    # Its x points to port, its y (starboard of that) ahead.
    np.testing.assert_allclose(sample.rates_I, (-0.2, 0.1, 0.3), atol=1e-12)


def test_what_it_says_of_its_attitude_is_how_noisy_that_is() -> None:
    imu = SimulatedImu(ImuSettings(), VRX_PLACE, at_rest(), 0, rng())
    told = [imu.sense(at_rest(), EPOCH_NS, DT_S) for _ in range(1500)]
    q = np.array([sample.q_NI * np.sign(sample.q_NI[0]) for sample in told])
    np.testing.assert_allclose(2 * q[:, 1:].std(axis=0), (0.01, 0.01, 0.02), rtol=0.08)
    np.testing.assert_allclose(told[0].attitude_variance, (1e-4, 1e-4, 4e-4))


def position(fix) -> np.ndarray:
    return FRAME.position_N(
        Place(
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            altitude_m=fix.altitude_m,
        )
    )


def test_a_receiver_tells_where_its_antenna_is_with_the_noise_that_it_tells() -> None:
    settings = ReceiverSettings()
    state = replace(truth(0.0), q_NB=np.array([[1.0, 0.0, 0.0, 0.0]]))
    receiver = SimulatedReceiver(settings, VRX_PLACE, FRAME, 0, rng())
    fixes = [receiver.sense(state, EPOCH_NS, 0.0) for _ in range(1500)]
    errors = np.array([position(fix) for fix in fixes]) - (state.position_N[0] + [-0.85, 0, -1.3])
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.1)
    np.testing.assert_allclose(errors.std(axis=0), (0.5, 0.5, 1.0), rtol=0.08)
    np.testing.assert_array_equal(fixes[0].covariance_N, np.diag([0.25, 0.25, 1.0]))


def test_an_error_that_wanders_stays_for_a_while_and_is_not_told() -> None:
    settings = with_settings(
        ReceiverSettings(), horizontal_sigma_m=0.001, wander_sigma_m=1.0, wander_time_s=60.0
    )
    receiver = SimulatedReceiver(settings, VRX_PLACE, FRAME, 0, rng(3))
    fixes = [receiver.sense(truth(0.0), EPOCH_NS, 0.0) for _ in range(40)]
    north = np.array([position(fix)[0] for fix in fixes])
    assert np.abs(np.diff(north)).max() < 0.25
    assert fixes[0].covariance_N[0, 0] == pytest.approx(1e-6)


def test_in_an_outage_there_is_no_fix() -> None:
    settings = with_settings(ReceiverSettings(), outages_s=((2.0, 3.0),))
    receiver = SimulatedReceiver(settings, VRX_PLACE, FRAME, 0, rng())
    valid = [receiver.sense(truth(t), EPOCH_NS, t).valid for t in (1.9, 2.0, 2.9, 3.0)]
    assert valid == [True, False, False, True]


def test_every_vessels_sensors_speak_at_their_rates_and_change_nothing() -> None:
    worlds = [make_world(load_scenario("head_on"), sensor="vrx16", seed=4) for _ in range(2)]
    navigation = Navigation(worlds[0])
    for world in worlds:
        world.advance(1.0, np.full((2, 2), 500.0))
    sensed = list(navigation.take())
    for vessel in range(2):
        imus = [cdr.decode_imu(s.payload) for s in sensed if (s.vessel, s.topic) == (vessel, "imu")]
        fixes = [s for s in sensed if (s.vessel, s.topic) == (vessel, "gps")]
        assert (len(imus), len(fixes)) == (100, 20)
        assert {b.stamp_ns - a.stamp_ns for a, b in pairwise(imus)} == {10**7}
    assert list(navigation.take()) == []
    np.testing.assert_array_equal(worlds[0].state.position_N, worlds[1].state.position_N)
    clouds = [world.cloud(0).points_S for world in worlds]
    np.testing.assert_array_equal(*clouds)

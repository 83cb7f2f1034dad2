from __future__ import annotations

import numpy as np
import pytest

from twinscrew.hil_sim.odometry import OdometrySettings, measure
from twinscrew.hil_sim.vessel.state import VesselState
from twinscrew.runtime.geometry import quaternion_from_euler

STATE = VesselState(
    position_N=np.array([[1.0, 2.0, 0.1], [30.0, 40.0, 0.2]]),
    q_NB=np.array([quaternion_from_euler(0.0, 0.0, 1.0), quaternion_from_euler(0.1, -0.2, 2.0)]),
    velocity_B=np.array([[0.0, 0.0, 0.0], [3.0, 0.1, -0.05]]),
    rates_B=np.array([[0.0, 0.0, 0.0], [0.01, 0.02, 0.3]]),
    thrust=np.zeros((2, 2)),
)


def test_without_noise_odometry_is_the_truth() -> None:
    odometry = measure(STATE, 1, 77, OdometrySettings(), np.random.default_rng(0))
    assert odometry.stamp_ns == 77
    np.testing.assert_array_equal(odometry.position_N, STATE.position_N[1])
    np.testing.assert_array_equal(odometry.q_NB, STATE.q_NB[1])
    np.testing.assert_array_equal(odometry.velocity_B, STATE.velocity_B[1])
    np.testing.assert_array_equal(odometry.rates_B, STATE.rates_B[1])


def test_noise_has_the_asked_deviation_and_keeps_attitudes_unit() -> None:
    settings = OdometrySettings(
        position_sigma_m=0.5, attitude_sigma_rad=0.02, velocity_sigma_mps=0.1, rate_sigma_radps=0.03
    )
    rng = np.random.default_rng(1)
    samples = [measure(STATE, 1, 0, settings, rng) for _ in range(2000)]
    for values, truth, sigma in (
        ([s.position_N for s in samples], STATE.position_N[1], 0.5),
        ([s.velocity_B for s in samples], STATE.velocity_B[1], 0.1),
        ([s.rates_B for s in samples], STATE.rates_B[1], 0.03),
    ):
        error = np.array(values) - truth
        # Of 2000 samples, the deviation is known to 1.6 % and the mean to 2.2 % of sigma (1 sigma).
        np.testing.assert_allclose(error.std(axis=0), sigma, rtol=0.08)
        np.testing.assert_allclose(error.mean(axis=0), 0.0, atol=0.11 * sigma)
    attitudes = np.array([s.q_NB for s in samples])
    np.testing.assert_allclose(np.linalg.norm(attitudes, axis=1), 1.0)
    # A small turn by (r, p, y) changes a unit quaternion by half its length.
    turned = 2 * np.arccos(np.clip(np.abs(attitudes @ STATE.q_NB[1]), 0, 1))
    assert np.sqrt(np.mean(turned**2)) == pytest.approx(0.02 * 3**0.5, rel=0.05)


def test_the_same_generator_state_gives_the_same_odometry() -> None:
    settings = OdometrySettings(position_sigma_m=1.0)
    first, second = (
        measure(STATE, 0, 0, settings, np.random.default_rng(5)).position_N for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)

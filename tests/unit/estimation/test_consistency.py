"""The filter's covariance is that of its errors: NEES in wind and waves, with VRX's noise.

Normalised estimation error squared, e' P^-1 e over the number of states, is 1 on the average for a
filter that knows how wrong it is; more, and it is too sure. Source: Bar-Shalom, Li and Kirubarajan
(2001), Estimation with Applications to Tracking and Navigation, sec. 5.4.2.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sensors.navigation import Navigation
from twinscrew.hil_sim.sitl_runtimes import DATUM
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.estimation.estimator import EstimationSettings, Estimator
from twinscrew.runtime.estimation.inertial import ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from twinscrew.runtime.estimation.sensors import SensorPlacement, SensorSettings
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_from_quaternion, wrap
from twinscrew.runtime.messages import cdr

RUNS, SAIL_S, LOOK_S = 12, 9.0, 3.0
IMU_B = SensorPlacement(SensorSettings()).imu_B
HORIZONTAL = [0, 1]


def true_state(world, imu):
    """The filter's state as it truly is."""
    state = world.state
    R_NB = rotation_from_quaternion(state.q_NB[0])
    x = np.zeros(15)
    x[POSITION] = state.position_N[0] + R_NB @ IMU_B
    x[VELOCITY] = R_NB @ (state.velocity_B[0] + np.cross(state.rates_B[0], IMU_B))
    x[ATTITUDE] = euler_from_quaternion(state.q_NB[0])
    x[GYRO_BIAS] = imu.gyro.bias
    x[12:] = imu.force.bias
    return x


def sail(seed):
    """Errors and covariances every few seconds of one boat under random thrust, (N, 15)."""
    world = make_world(load_scenario("random", 1, 0, seed), seed=seed)
    navigation = Navigation(world)
    estimator = Estimator(EstimationSettings(datum=DATUM))
    rng = np.random.default_rng(seed)
    looks = []
    while world.time_s < SAIL_S:
        thrust = rng.uniform(-200.0, 900.0, (1, 2))
        for _ in range(10):
            world.advance(0.1, thrust)
            for _, topic, payload in navigation.take():
                if topic == "gps":
                    estimator.fix(cdr.decode_fix(payload))
                else:
                    estimator.imu(cdr.decode_imu(payload))
        if world.time_s % LOOK_S < 0.05:
            e = true_state(world, navigation.imus[0]) - estimator.inertial.x
            e[ATTITUDE] = wrap(e[ATTITUDE])
            looks.append((e, estimator.inertial.P.copy()))
    return looks


@pytest.fixture(scope="module")
def runs():
    return [sail(seed) for seed in range(RUNS)]


def nees(looks, states):
    part = np.ix_(states, states)
    return [float(e[states] @ np.linalg.solve(P[part], e[states])) for e, P in looks]


@pytest.mark.slow
@pytest.mark.parametrize(
    "states",
    [HORIZONTAL, [3, 4], [6, 7], [8], [9, 10], [11], [12, 13], [0, 1, 3, 4, 6, 7, 8, 9, 10, 11]],
    ids=["position", "velocity", "tilt", "heading", "gyro", "yaw gyro", "force", "all"],
)
def test_errors_are_as_large_as_the_covariance_says(runs, states):
    """Runs are independent of each other, looks within one are not: the last look of each."""
    last = sum(nees([looks[-1]], states)[0] for looks in runs)
    low, high = chi2.ppf([0.0005, 0.9995], len(states) * RUNS)
    assert low < last < high


def test_the_estimate_is_better_than_the_fixes(runs):
    errors = np.array([e for looks in runs for e, _ in looks[1:]])
    assert np.sqrt((errors[:, HORIZONTAL] ** 2).mean()) < 0.2  # [m] a fix: 0.5
    assert np.sqrt((errors[:, 3:5] ** 2).mean()) < 0.12  # [m/s]
    assert np.sqrt((errors[:, 8] ** 2).mean()) < 0.02  # [rad] one reading: 0.02

"""Odometry of the vessel's origin from the state of its IMU."""

import numpy as np

from twinscrew.runtime.estimation.events import Notes
from twinscrew.runtime.estimation.inertial import InertialFilter, InertialSettings
from twinscrew.runtime.estimation.output import OdometryOutput, odometry
from twinscrew.runtime.estimation.sensors import ImuInBody
from twinscrew.runtime.estimation.settings import EstimationSettings

IMU_B = np.array([0.5, 0.0, -1.0])
EAST = np.pi / 2


def felt(stamp_ns: int = 0, yaw_rate: float = 0.0) -> ImuInBody:
    rates_B = np.array([0.0, 0.0, yaw_rate])
    return ImuInBody(stamp_ns, rates_B, np.array([0.0, 0.0, -9.81]), None, None, None, None)


def known_to(sigma_m: float, sigma_mps: float) -> InertialFilter:
    settings = InertialSettings(first_speed_mps=sigma_mps)
    R, zero = sigma_m**2 * np.eye(3), np.zeros(3)
    return InertialFilter(settings, zero, R, zero, 1e-4 * np.eye(3))


def test_the_arm_to_the_imu_and_the_gyroscopes_bias_are_taken_away() -> None:
    x = np.zeros(15)
    x[:3], x[6:9] = (10.0, 20.0, 0.0), (0.0, 0.0, EAST)
    x[3:6] = (-0.1, 2.0, 0.0)  # the unit swings to the south as the bow turns to starboard
    x[9:12] = (0.0, 0.0, 0.3)
    given = odometry(felt(7, yaw_rate=0.5), x, IMU_B)
    assert given.stamp_ns == 7
    np.testing.assert_allclose(given.position_N, [10.0, 19.5, 1.0], atol=1e-12)
    np.testing.assert_allclose(given.velocity_B, [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(given.rates_B, [0.0, 0.0, 0.2])
    np.testing.assert_allclose(given.q_NB, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])


def test_it_is_given_once_in_each_multiple_of_its_period() -> None:
    output = OdometryOutput(EstimationSettings(rate_hz=20.0), IMU_B, Notes())
    stamps_ns = range(3_000_000, 200_000_000, 10_000_000)
    given = [t for t in stamps_ns if output.step(felt(t), known_to(0.1, 0.1)) is not None]
    assert given == [3_000_000, 53_000_000, 103_000_000, 153_000_000]


def test_it_is_given_only_while_place_and_velocity_are_known_and_every_change_is_told() -> None:
    notes = Notes()
    output = OdometryOutput(EstimationSettings(), IMU_B, notes)
    known = [known_to(0.1, 0.1), known_to(0.1, 0.6), known_to(2.1, 0.1), known_to(0.1, 0.1)]
    given = [output.step(felt(n * 50_000_000), one) is not None for n, one in enumerate(known)]
    assert given == [True, False, False, True]
    assert [event.name for event in notes.take()] == [
        "estimate_ready",
        "estimate_lost",
        "estimate_ready",
    ]


def test_the_uncertainty_is_that_of_the_worst_direction_in_the_plane() -> None:
    R = np.diag([1.0, 4.0, 100.0])
    turn = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    one = known_to(1.0, 0.3)
    one.place(np.zeros(3), turn @ R @ turn.T)
    assert np.isclose(one.horizontal_sigma(slice(0, 3)), 2.0)
    assert np.isclose(one.horizontal_sigma(slice(3, 6)), 0.3)

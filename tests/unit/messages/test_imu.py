"""sensor_msgs/Imu: what units leave out, and what cannot be used."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Imu

IMU = Imu(
    stamp_ns=5,
    rates_I=np.array((0.1, 0.2, 0.3)),
    force_I=np.array((0.0, 0.0, -9.8)),
    q_NI=quaternion_from_euler(0.1, -0.2, 2.0),
)
NUMBERS = 37
RATES_COVARIANCE, FORCE_COVARIANCE = 4 + 9 + 3, 4 + 9 + 3 + 9 + 3


def with_number(index: int, value: float) -> bytes:
    payload = bytearray(cdr.encode_imu(IMU))
    struct.pack_into("<d", payload, len(payload) - 8 * (NUMBERS - index), value)
    return bytes(payload)


def test_what_goes_out_comes_back():
    again = cdr.decode_imu(cdr.encode_imu(IMU))
    np.testing.assert_allclose(again.q_NI, IMU.q_NI, atol=1e-15)
    np.testing.assert_array_equal(again.rates_I, IMU.rates_I)
    np.testing.assert_array_equal(again.force_I, IMU.force_I)


def test_a_unit_at_rest_feels_gravity_upwards_in_ros_and_so_negative_down_here():
    payload = cdr.encode_imu(IMU)
    (z,) = struct.unpack_from("<d", payload, len(payload) - 8 * 10)
    assert z == 9.8


def test_a_unit_without_an_attitude_has_none():
    assert cdr.decode_imu(with_number(4, -1.0)).q_NI is None
    assert cdr.decode_imu(cdr.encode_imu(replace(IMU, q_NI=None))).q_NI is None


def test_covariances_that_are_all_zero_are_not_known():
    imu = cdr.decode_imu(cdr.encode_imu(IMU))
    assert imu.attitude_variance is imu.rates_variance is imu.force_variance is None


@pytest.mark.parametrize("index", [RATES_COVARIANCE, FORCE_COVARIANCE])
def test_a_unit_that_feels_only_half_is_refused(index):
    with pytest.raises(MessageError, match="of no use"):
        cdr.decode_imu(with_number(index, -1.0))


@pytest.mark.parametrize("index", [0, 13, 25])
def test_numbers_that_are_not_finite_are_refused(index):
    with pytest.raises(MessageError, match="not finite"):
        cdr.decode_imu(with_number(index, float("nan")))

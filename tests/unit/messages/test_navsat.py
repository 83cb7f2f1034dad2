"""sensor_msgs/NavSatFix: what receivers leave out, and what cannot be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Fix

FIX = Fix(stamp_ns=5, valid=True, latitude_deg=10.0, longitude_deg=-20.0, altitude_m=3.0)
KIND = -1
"""Where the covariance's type is: the last byte."""


def with_covariance(*diagonal: float) -> bytes:
    return cdr.encode_fix(replace(FIX, covariance_N=np.diag(diagonal)))


def test_a_covariance_of_unknown_type_is_none():
    payload = bytearray(with_covariance(1.0, 2.0, 3.0))
    assert cdr.decode_fix(payload).covariance_N is not None
    payload[KIND] = 0
    assert cdr.decode_fix(payload).covariance_N is None


@pytest.mark.parametrize("diagonal", [(0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (1.0, math.nan, 1.0)])
def test_a_covariance_that_was_never_filled_in_is_none(diagonal):
    assert cdr.decode_fix(with_covariance(*diagonal)).covariance_N is None


def test_a_receiver_without_a_fix_says_so_whatever_its_numbers():
    lost = replace(FIX, valid=False, latitude_deg=math.nan, longitude_deg=1e9)
    assert not cdr.decode_fix(cdr.encode_fix(lost)).valid


@pytest.mark.parametrize(("latitude", "longitude"), [(91.0, 0.0), (0.0, 361.0), (math.nan, 0.0)])
def test_a_place_that_is_not_on_the_earth_is_refused(latitude, longitude):
    fix = replace(FIX, latitude_deg=latitude, longitude_deg=longitude)
    with pytest.raises(MessageError, match="no place on the earth"):
        cdr.decode_fix(cdr.encode_fix(fix))


def test_an_altitude_that_is_not_known_is_nan():
    assert math.isnan(cdr.decode_fix(cdr.encode_fix(replace(FIX, altitude_m=math.inf))).altitude_m)

"""Whatever sensors say, in whatever order, the estimation answers with numbers or not at all."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.circling import EPOCH_NS, WITH_DATUM
from tests.harness.work import examples

from twinscrew.runtime.estimation.estimator import Estimator
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Fix, Imu

ODD = st.one_of(st.floats(-3.0, 3.0), st.floats(-1e8, 1e8))
VECTORS = st.builds(lambda *v: np.array(v), ODD, ODD, ODD)
ANGLES = st.floats(-math.pi, math.pi)
VARIANCES = st.one_of(st.none(), st.builds(lambda *v: np.array(v), *[st.floats(1e-12, 1e12)] * 3))
ATTITUDES = st.one_of(st.none(), st.builds(quaternion_from_euler, ANGLES, ANGLES, ANGLES))
STEPS_NS = st.sampled_from([10_000_000] * 8 + [0, -10_000_000, 100_000_000, 10**9, -(10**10)])
IMUS = st.builds(
    Imu,
    stamp_ns=STEPS_NS,
    rates_I=VECTORS,
    force_I=VECTORS,
    q_NI=ATTITUDES,
    attitude_variance=VARIANCES,
    rates_variance=VARIANCES,
    force_variance=VARIANCES,
)
FIXES = st.builds(
    Fix,
    stamp_ns=STEPS_NS,
    valid=st.booleans(),
    latitude_deg=st.one_of(st.just(-33.7221), st.floats(-90.0, 90.0)),
    longitude_deg=st.one_of(st.just(150.6739), st.floats(-360.0, 360.0)),
    altitude_m=st.one_of(st.just(math.nan), st.floats(-1e8, 1e8)),
    covariance_N=st.one_of(
        st.none(),
        st.builds(lambda a, b: np.array([[a, b, 0], [b, a, 0], [0, 0, a]]), ODD.map(abs), ODD),
    ),
)


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(st.lists(st.one_of(IMUS, IMUS, FIXES), max_size=60))
def test_nothing_makes_it_raise_or_give_what_is_no_number(messages):
    estimator = Estimator(WITH_DATUM)
    now_ns = EPOCH_NS
    for message in messages:
        now_ns += message.stamp_ns
        moved = type(message)(
            **{name: getattr(message, name) for name in message.__slots__} | {"stamp_ns": now_ns}
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # overflow, on its way to nonsense
            odometry = estimator.imu(moved) if isinstance(moved, Imu) else estimator.fix(moved)
        if odometry is not None:
            for name in ("position_N", "q_NB", "velocity_B", "rates_B"):
                assert np.isfinite(getattr(odometry, name)).all()
            assert math.isclose(np.linalg.norm(odometry.q_NB), 1.0, rel_tol=1e-9)

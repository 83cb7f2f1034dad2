"""One track: its first covariance, its update, its jumps."""

import numpy as np
import pytest

from twinscrew.runtime.tracking.displacement import MeasuredVelocity, Sight
from twinscrew.runtime.tracking.measurement import NO_STRIPS, observation_matrix
from twinscrew.runtime.tracking.track import Track, doubted, first_covariance, inverse_2x2

H = observation_matrix(np.array([[0.6, 0.8]]))[0]
R = np.diag([0.01, 0.02])
PRIOR = np.array([0.0, 0.0, 4.0, 4.0, 0.09, 0.04])


def track():
    return Track(np.array([5.0, 6.0]), H, R, 2.0, PRIOR, Sight(0, NO_STRIPS))


def test_the_first_covariance_is_the_limit_of_a_vague_prior():
    P = np.diag([1e9, 1e9, *PRIOR[2:]])
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    updated = (np.eye(6) - K @ H) @ P
    assert first_covariance(H, R, PRIOR) == pytest.approx(updated, abs=1e-4)


def test_a_small_innovation_is_left_to_the_filter():
    one, same = track(), track()
    z = H @ one.filter.x + 0.05
    one.update(z, H, R, excess=-0.5)
    same.filter.update(z, R=R, H=H)
    assert np.array_equal(one.filter.x, same.filter.x)


def test_a_jump_goes_to_the_bias_and_not_to_the_velocity():
    jumping, plain = track(), track()
    for each in (jumping, plain):
        for _ in range(20):
            F = np.eye(6)
            F[0, 2] = F[1, 3] = 0.1
            each.predict(0.1, F, np.zeros((6, 6)))
            each.update(H @ np.array([5, 6, 0, 0, 0, 0.0]), H, R)
    z = H @ np.array([5, 6, 0, 0, 0, 0.0]) + np.array([1.5, 0.0])
    y, S = z - H @ plain.filter.x, H @ plain.filter.P @ H.T + R
    jumping.update(z, H, R, excess=float(y @ np.linalg.solve(S, y)) / 2.0**2 - 1.0)
    plain.update(z, H, R)
    assert np.hypot(*jumping.filter.x[2:4]) < 0.7 * np.hypot(*plain.filter.x[2:4])
    assert np.hypot(*jumping.filter.x[4:]) > 2 * np.hypot(*plain.filter.x[4:])


def test_covariances_stay_symmetric_and_positive():
    one, rng = track(), np.random.default_rng(0)
    for _ in range(200):
        one.predict(0.1, np.eye(6), 1e-3 * np.eye(6))
        one.update(np.array([5.0, 6.0]) + rng.normal(size=2), H, R, excess=rng.normal())
    P = one.filter.P
    assert np.allclose(P, P.T)
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_the_short_inverse_is_the_inverse():
    S = np.array([[2.0, 0.3], [0.4, 1.0]])
    assert inverse_2x2(S) @ S == pytest.approx(np.eye(2))


def test_the_excess_brings_the_innovation_to_the_limit():
    one, z = track(), np.array([9.0, 6.0])
    y, S = z - H @ one.filter.x, H @ one.filter.P @ H.T + R
    distance2 = float(y @ np.linalg.solve(S, y))
    one.update(z, H, R, excess=distance2 / 2.0**2 - 1.0)
    assert one.filter.mahalanobis == pytest.approx(2.0)


def velocity(north, variance=0.01):
    return MeasuredVelocity(np.array([north, 0.0]), variance * np.eye(2))


def test_a_velocity_is_taken_in_as_if_it_were_measured_alone():
    both, apart = track(), track()
    z = np.array([5.1, 6.0])
    both.update(z, H, R, velocity=velocity(1.0))
    apart.filter.update(z, R=R, H=H)
    apart.filter.update(np.array([1.0, 0.0]), R=0.01 * np.eye(2), H=np.eye(6)[2:4])
    assert both.filter.x == pytest.approx(apart.filter.x, abs=1e-9)
    assert pytest.approx(apart.filter.P, abs=1e-9) == both.filter.P


def test_a_likely_velocity_is_not_doubted():
    likely = velocity(3.0)
    assert doubted(likely, np.zeros(6), np.diag(PRIOR), 2.0) is likely


def test_a_velocity_is_doubted_until_it_lies_on_the_limit():
    P = np.diag([0, 0, 0.03, 0.03, 0, 0])
    R = doubted(velocity(1.0), np.zeros(6), P, 2.0).R
    assert 1.0**2 / (P[2, 2] + R[0, 0]) == pytest.approx(2.0**2)


def test_a_velocity_that_is_told_again_and_again_is_believed():
    one = track()
    for speed, times in ((0.0, 20), (3.0, 30)):
        for _ in range(times):
            one.predict(0.1, np.eye(6), 0.1 * np.diag([0, 0, 0.5, 0.5, 0, 0]))
            seen = doubted(velocity(speed, 0.02), one.filter.x, one.filter.P, 2.0)
            one.update(H @ one.filter.x, H, R, velocity=seen)
    assert one.filter.x[2] == pytest.approx(3.0, abs=0.1)

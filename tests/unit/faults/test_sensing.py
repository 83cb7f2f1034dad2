import numpy as np
import pytest
from tests.harness.boat import cloud, odometry, stamp

from twinscrew.hil_sim.faults.kinds import ClockJump, Noise
from twinscrew.hil_sim.faults.sensing import (
    Freezing,
    Jumping,
    NoisyOdometry,
    NoisyPoints,
    stamp_of,
    with_stamp,
)
from twinscrew.runtime.messages import cdr

POINTS = np.random.default_rng(1).normal(0.0, 8.0, (500, 3))


def scan(time_s: float) -> bytes:
    return cdr.encode_point_cloud(cloud(time_s, POINTS))


@pytest.mark.parametrize("encoded", [scan(3.25), cdr.encode_odometry(odometry(3.25))])
def test_a_stamp_is_read_and_replaced_and_nothing_else(encoded: bytes) -> None:
    assert stamp_of(encoded) == stamp(3.25)
    changed = with_stamp(encoded, stamp(-7.5))
    assert stamp_of(changed) == stamp(-7.5)
    assert with_stamp(changed, stamp(3.25)) == encoded


def test_a_frozen_sensor_repeats_itself_with_or_without_new_stamps() -> None:
    for moving in (False, True):
        effect = Freezing(stamps_move=moving)
        first = effect.put(cdr.encode_odometry(odometry(0.0, 1.0)), 0.0)
        (second,) = effect.put(cdr.encode_odometry(odometry(0.1, 2.0)), 0.1)
        told = cdr.decode_odometry(second)
        assert told.position_N[0] == pytest.approx(1.0)
        assert told.stamp_ns == stamp(0.1 if moving else 0.0)
        assert len(first) == 1


def test_a_clock_jumps_by_what_was_said() -> None:
    (late,) = Jumping(ClockJump(jump_s=-10.0)).put(scan(3.0), 0.0)
    assert stamp_of(late) == stamp(-7.0)
    assert np.array_equal(cdr.decode_point_cloud(late).points_S, cloud(3.0, POINTS).points_S)


def test_a_clock_may_jump_to_and_fro() -> None:
    line = Jumping(ClockJump(jump_s=-10.0, every=2))
    stamps = [stamp_of(line.put(scan(k), 0.0)[0]) for k in range(20, 24)]
    assert stamps == [stamp(20), stamp(11), stamp(22), stamp(13)]


def test_spray_moves_echoes_along_their_rays() -> None:
    (noisy,) = NoisyPoints(Noise(sigma_m=0.3), np.random.default_rng(0)).put(scan(0.0), 0.0)
    seen = cdr.decode_point_cloud(noisy).points_S.astype(float)
    off = np.linalg.norm(seen, axis=1) - np.linalg.norm(POINTS, axis=1)
    across = np.linalg.norm(np.cross(seen, POINTS), axis=1) / np.linalg.norm(POINTS, axis=1)
    assert np.std(off) == pytest.approx(0.3, rel=0.15)
    assert across.max() < 1e-3


def test_phantoms_take_the_place_of_echoes() -> None:
    (noisy,) = NoisyPoints(Noise(phantoms=50), np.random.default_rng(0)).put(scan(0.0), 0.0)
    seen = cdr.decode_point_cloud(noisy).points_S
    assert len(seen) == len(POINTS)
    assert np.sum(np.any(np.abs(seen - POINTS) > 1e-3, axis=1)) == 50


def test_an_empty_scan_stays_empty() -> None:
    empty = cdr.encode_point_cloud(cloud(0.0))
    (noisy,) = NoisyPoints(Noise(sigma_m=1.0, phantoms=10), np.random.default_rng(0)).put(
        empty, 0.0
    )
    assert len(cdr.decode_point_cloud(noisy).points_S) == 0


def test_a_position_is_off_on_the_water_only() -> None:
    effect = NoisyOdometry(Noise(sigma_m=5.0), np.random.default_rng(0))
    told = [
        cdr.decode_odometry(effect.put(cdr.encode_odometry(odometry(0.05 * k)), 0.0)[0])
        for k in range(300)
    ]
    off = np.array([message.position_N for message in told])
    assert np.std(off[:, :2]) == pytest.approx(5.0, rel=0.15)
    assert not off[:, 2].any()


def test_a_sensor_freezes_at_what_it_said_last() -> None:
    effect = Freezing(cdr.encode_odometry(odometry(-0.1, 7.0)), stamps_move=True)
    (told,) = effect.put(cdr.encode_odometry(odometry(0.0, 8.0)), 0.0)
    assert cdr.decode_odometry(told).position_N[0] == pytest.approx(7.0)

"""The noise has the distributions of the paper's eqs. (13) to (15)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest, norm, vonmises

from twinscrew.training.episodes import Stream, slot_stream
from twinscrew.training.perception import Noise, NoiseSettings, radius_factors


def test_position_and_velocity_noise_are_normal_with_their_deviations() -> None:
    settings = NoiseSettings(position_m=0.05, velocity_mps=0.2)
    noise = Noise(settings, [np.random.default_rng(0)], (20_000,), block=1)
    position, velocity, _ = (part[0] for part in noise.values(noise.next()))
    for values, deviation in ((position, 0.05), (velocity, 0.2)):
        for part in (values.real, values.imag):
            assert kstest(part, norm(scale=deviation).cdf).pvalue > 0.001
    assert abs(np.corrcoef(position.real, position.imag)[0, 1]) < 0.03


@pytest.mark.parametrize("kappa", [0.5, 1.0, 4.0])
def test_the_radius_factor_is_von_mises_distributed_around_its_mean(kappa: float) -> None:
    factors = radius_factors(0.8, kappa).astype(np.float64)
    w = (factors - 0.8) / 0.2 * np.pi
    expected = vonmises(kappa).cdf(w)
    assert np.abs(expected - (np.arange(w.size) + 0.5) / w.size).max() < 1e-4
    assert factors.min() >= 0.6
    assert factors.max() <= 1.0


def test_a_concentration_of_zero_is_uniform() -> None:
    factors = radius_factors(0.8, 0.0)
    assert np.allclose(np.diff(factors), 0.4 / factors.size, atol=1e-7)


def test_perfect_perception_has_no_noise() -> None:
    noise = Noise(NoiseSettings(perfect=True), [np.random.default_rng(0)], (5,))
    position, velocity, radius = noise.values(noise.next())
    assert not position.any()
    assert not velocity.any()
    assert (radius == 1.0).all()


def test_a_bank_gives_each_slot_its_own_numbers_across_blocks() -> None:
    def bank(slots: list[int]) -> Noise:
        streams = [slot_stream(3, k, Stream.PERCEPTION) for k in slots]
        return Noise(NoiseSettings(), streams, (2, 3), block=4)

    both, one = bank([5, 6]), bank([6])
    drawn = [(both.next()[1].copy(), one.next()[0].copy()) for _ in range(10)]
    for left, right in drawn:
        assert np.array_equal(left, right)
    assert not np.array_equal(drawn[0][0], drawn[4][0])

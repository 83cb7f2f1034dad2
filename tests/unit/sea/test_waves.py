"""The wave field against VRX's formulas, evaluated in east-north-up by hand."""

import math

import numpy as np
import pytest

from twinscrew.hil_sim.sea.sea import (
    WaveSettings,
    sample_waves,
    spectrum,
    wave_elevation,
    wave_growth,
)
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert

RNG = np.random.default_rng(0)


def vrx_height(x, y, t, *, period=5.0, gain=0.3, scale=1.1, angle=0.4, direction=0.0, tau=2.0):
    """VRX's PMS field at ENU (x, y), term by term."""
    peak = 2 * math.pi / period
    bands = [1 - 1 / scale, (scale - 1 / scale) / 2, scale - 1]
    height = 0.0
    for n, band in zip((-1, 0, 1), bands, strict=True):
        w = peak * scale**n
        s = 0.0081 * 9.81**2 / w**5 * math.exp(-1.25 * (peak / w) ** 4)
        a = gain * math.sqrt(2 * s * band * peak)
        k = w * w / 9.8
        towards = direction + n * angle
        along = x * math.cos(towards) + y * math.sin(towards)
        height += a * math.cos(k * along - w * t)
    return height * (1 - math.exp(-t / tau))


def test_the_default_waves_are_vrxs():
    waves = sample_waves(WaveSettings(), RNG)
    for north, east, t in [(0, 0, 1.0), (12.0, -7.0, 3.3), (-40.0, 55.0, 80.0)]:
        got = wave_elevation(waves, np.array([float(north), float(east)]), t)
        assert got == pytest.approx(vrx_height(x=east, y=north, t=t), abs=1e-12)


def test_a_direction_of_vrx_turns_into_a_heading():
    # VRX's direction 0.5 rad, counter-clockwise from east, is 90 deg - 28.6 deg.
    waves = sample_waves(WaveSettings(towards_deg=90 - math.degrees(0.5)), RNG)
    got = wave_elevation(waves, np.array([3.0, -8.0]), 20.0)
    assert got == pytest.approx(vrx_height(x=-8.0, y=3.0, t=20.0, direction=0.5), abs=1e-12)


def test_the_middle_wave_is_as_long_as_deep_water_says():
    wave = sample_waves(WaveSettings(), RNG)
    length = 2 * math.pi / np.linalg.norm(wave.wavenumber_N[1])
    assert length == pytest.approx(9.8 * 25 / (2 * math.pi), rel=1e-12)


def test_a_crest_runs_where_the_setting_says():
    waves = sample_waves(WaveSettings(towards_deg=0.0, spread_rad=0.0, ramp_s=0.0), RNG)
    north = np.linspace(-2, 6, 801)
    line = np.column_stack([north, np.zeros_like(north)])
    crest = [north[np.argmax(wave_elevation(waves, line, t))] for t in (0.0, 0.5)]
    assert crest[0] == pytest.approx(0.0, abs=0.02)
    assert crest[1] == pytest.approx(0.5 * 1.2566 * 9.8 / 1.2566**2, rel=0.1)


def test_the_spectrum_peaks_at_its_peak():
    w = np.linspace(0.5, 4, 3501)
    assert w[np.argmax(spectrum(w, 1.5))] == pytest.approx(1.5, abs=0.002)


def test_waves_grow_from_flat_water():
    assert wave_growth(2.0, 0.0) == 0.0
    assert wave_growth(2.0, 2.0) == pytest.approx(1 - math.exp(-1))
    assert wave_growth(2.0, -1.0) == 0.0
    assert wave_growth(0.0, 0.0) == 1.0


def test_elevation_keeps_the_shape_of_the_places():
    waves = sample_waves(WaveSettings(), RNG)
    assert wave_elevation(waves, np.zeros((4, 3, 2)), 5.0).shape == (4, 3)
    assert wave_elevation(waves, np.zeros(2), 5.0).shape == ()


def test_random_phases_change_the_waves_but_not_their_size():
    settings = WaveSettings(random_phase=True)
    a, b = (sample_waves(settings, np.random.default_rng(seed)) for seed in (1, 2))
    assert not np.allclose(a.phase, b.phase)
    np.testing.assert_array_equal(a.amplitude, b.amplitude)


@pytest.mark.parametrize(
    "values", [{"scale": 1.0}, {"period_s": 0.0}, {"gain": -0.1}, {"ramp_s": -1.0}]
)
def test_impossible_waves_are_refused_by_their_key(values):
    with pytest.raises(ConfigError, match=next(iter(values))):
        convert(values, WaveSettings)

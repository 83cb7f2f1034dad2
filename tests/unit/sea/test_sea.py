"""The sea as a whole, and the shipped ones."""

import numpy as np
import pytest

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings, wave_elevation
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert, load, shipped


def preset(name: str) -> SeaSettings:
    return load(shipped("sea", name), SeaSettings)


GUSTY = SeaSettings(waves=WaveSettings(random_phase=True), wind=WindSettings(gust_mps=2.0))


def test_the_defaults_are_the_papers_sea():
    assert preset("paper") == SeaSettings()


def test_the_calm_sea_is_flat_and_still():
    calm = Sea(preset("calm"), np.random.default_rng(0))
    assert calm.elevation(np.array([10.0, -3.0]), 30.0) == 0.0
    np.testing.assert_array_equal(np.abs(calm.wind(30.0)), [0.0, 0.0])


def test_the_rough_sea_is_rougher_than_the_papers():
    places = np.random.default_rng(5).uniform(-50, 50, (2000, 2))
    seas = [Sea(preset(name), np.random.default_rng(0)) for name in ("paper", "rough")]
    paper, rough = (sea.elevation(places, 60.0).std() for sea in seas)
    assert rough > 1.5 * paper > 0.0


def test_the_same_seed_gives_the_same_sea():
    one, two = (Sea(GUSTY, np.random.default_rng(7)) for _ in range(2))
    place = np.array([4.0, 2.0])
    assert one.elevation(place, 9.0) == two.elevation(place, 9.0)
    np.testing.assert_array_equal(one.wind(9.0), two.wind(9.0))


def test_another_seed_gives_another_sea():
    one, two = (Sea(GUSTY, np.random.default_rng(seed)) for seed in (7, 8))
    place = np.array([4.0, 2.0])
    assert one.elevation(place, 9.0) != two.elevation(place, 9.0)
    assert not np.array_equal(one.wind(9.0), two.wind(9.0))


def test_the_sea_draws_nothing_from_its_generator_after_it_is_made():
    rng = np.random.default_rng(7)
    sea = Sea(GUSTY, rng)
    state = rng.bit_generator.state
    sea.wind(1000.0)
    sea.elevation(np.zeros(2), 1000.0)
    assert rng.bit_generator.state == state


def test_gusts_do_not_depend_on_whether_phases_are_drawn():
    fixed = SeaSettings(waves=WaveSettings(), wind=GUSTY.wind)
    one, two = (Sea(settings, np.random.default_rng(7)) for settings in (GUSTY, fixed))
    np.testing.assert_array_equal(one.wind(9.0), two.wind(9.0))


def test_the_table_for_the_native_step_holds_the_same_waves():
    sea = Sea(GUSTY, np.random.default_rng(1))
    place, t = np.array([11.0, -6.0]), 12.5
    a, k_n, k_e, w, phase = sea.wave_table.T
    by_hand = np.sum(a * np.cos(k_n * 11.0 + k_e * -6.0 - w * t + phase)) * sea.wave_growth(t)
    assert by_hand == pytest.approx(float(wave_elevation(sea.waves, place, t)), abs=1e-14)


def test_an_unknown_sea_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError, match="'calm', 'paper', 'rough'"):
        preset("red")


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("wind.mean_mps", {"wind": {"mean_mps": 1e9}}),
        ("wind.gust_mps", {"wind": {"gust_mps": 151.0}}),
        ("current_mps", {"current_mps": [0.0, -21.0]}),
    ],
)
def test_a_storm_or_a_stream_that_is_nowhere_on_earth_is_refused_by_key(key, values):
    with pytest.raises(ConfigError, match=key):
        convert(values, SeaSettings)

"""Risk levels: what may be typed, and how the adaptive one follows the nearest hull."""

import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.policy.load import load_policy
from twinscrew.runtime.policy.risk import RiskSettings, adaptive_level, parse_risk

SETTINGS = RiskSettings(level="adaptive", floor=0.2, distance_m=10.0, own_radius_m=3.0)


def seen(*objects):
    rows, mask = np.zeros((5, 5), np.float32), np.zeros(5, np.float32)
    for k, (x, y, radius) in enumerate(objects):
        rows[k], mask[k] = (x, y, 0.0, 0.0, radius), 1.0
    return rows, mask


@pytest.mark.parametrize(
    ("objects", "level"),
    [
        ([], 1.0),
        ([(20.0, 0.0, 2.0)], 1.0),
        ([(0.0, -15.0, 2.0)], 1.0),
        ([(0.0, -10.0, 2.0)], 0.2 + 0.8 * 0.5),
        ([(15.0, 0.0, 2.0), (6.0, 8.0, 4.5)], 0.2 + 0.8 * 0.25),
        ([(3.0, 4.0, 2.0)], 0.2),
        ([(1.0, 0.0, 2.0)], 0.2),
    ],
)
def test_alpha_falls_linearly_with_the_smallest_gap(objects, level):
    assert adaptive_level(*seen(*objects), SETTINGS) == pytest.approx([level])


def test_many_vessels_are_answered_at_once():
    rows = [seen((9.0, 0.0, 1.0)), seen(), seen((4.0, 0.0, 1.0))]
    objects, mask = (np.stack(part) for part in zip(*rows, strict=True))
    levels = adaptive_level(objects, mask, SETTINGS)
    assert levels.shape == (3, 1)
    assert levels[:, 0].tolist() == pytest.approx([0.6, 1.0, 0.2])


@pytest.mark.parametrize(
    ("text", "level"), [(None, "shipped"), ("0.5", 0.5), ("1", 1.0), ("adaptive", "adaptive")]
)
def test_a_level_is_read_as_it_is_typed(text, level):
    assert parse_risk(text).level == level


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "nan", "bold"])
def test_a_level_that_is_none_is_refused_with_what_is_allowed(text):
    with pytest.raises(ConfigError, match=r"adaptive.*--risk|--risk.*adaptive"):
        parse_risk(text)


@pytest.mark.parametrize("name", ["apf", "mpc"])
def test_a_baseline_takes_no_level(name):
    with pytest.raises(PolicyError, match="takes no risk level"):
        load_policy(name, risk=RiskSettings(level=0.5))

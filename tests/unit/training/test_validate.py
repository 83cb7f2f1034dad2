import numpy as np
import pytest
import torch
from torch import nn

from twinscrew.training.environment import EnvironmentSettings
from twinscrew.training.evaluate import Evaluation, NetworkPolicy, Score, validate
from twinscrew.training.perception import Observations as Seen


class Ahead(nn.Module):
    """More thrust on both sides, for ever."""

    def __init__(self):
        super().__init__()
        self.parameter = nn.Parameter(torch.ones(1))

    def forward(self, observations):
        return torch.ones(len(observations.ego), 2) * self.parameter


def evaluation(rate, time_s):
    return Evaluation(100, rate, (0.0, 1.0), time_s, 0, 0, 0, 10.0)


def test_only_vessels_on_the_water_are_asked_and_actions_become_rates():
    seen = Seen.empty((2, 3))
    active = np.array([[True, False, True], [False, False, True]])
    rates = NetworkPolicy(Ahead(), 0.5).rates(seen, active)
    assert rates[active].tolist() == [[1000.0, 1000.0]] * 3
    assert not rates[~active].any()


def test_a_score_is_the_mean_over_the_settings():
    score = Score((evaluation(1.0, 15.0), evaluation(0.5, None)))
    assert score.success == 0.75
    assert score.travel_time_s == pytest.approx((15 + 90) / 2)
    assert "rough_success" not in score.record()


def test_rough_conditions_count_as_much_as_calm_ones():
    calm, rough = (evaluation(1.0, 20.0),), (evaluation(0.9, 20.0),)
    assert Score(calm, rough).value == pytest.approx(0.95 - 0.001 * 20)
    assert Score(calm).value == pytest.approx(1.0 - 0.001 * 20)


@pytest.mark.slow
def test_six_settings_are_sailed_and_rough_ones_if_asked():
    policy = NetworkPolicy(Ahead(), 0.5)
    assert len(validate(policy, 1, 0).settings) == 6
    score = validate(policy, 2, 0, EnvironmentSettings(park=True))
    assert [one.episodes for one in score.rough] == [2] * 6

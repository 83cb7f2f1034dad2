import pytest

from twinscrew.training.bench_learner import update_speed


def test_samples_a_second_are_the_batch_over_the_time_of_an_update():
    speed = update_speed()
    assert speed["samples_per_s"] == pytest.approx(256 / (speed["update_ms"] * 1e-3))

import numpy as np
import pytest

from twinscrew.runtime.vessel.summary import Latencies


def test_percentiles_are_within_a_thousandth_of_the_exact_ones() -> None:
    values = np.random.default_rng(1).lognormal(0.0, 1.0, 20_000)
    latencies = Latencies()
    for value in values:
        latencies.add(float(value))
    summary = latencies.summary()
    assert summary.count == 20_000
    assert summary.p50 == pytest.approx(np.percentile(values, 50), rel=2e-3)
    assert summary.p99 == pytest.approx(np.percentile(values, 99), rel=2e-3)
    assert summary.max == values.max()


def test_no_latency_is_all_zero_and_extremes_are_kept() -> None:
    latencies = Latencies()
    assert latencies.summary().as_dict() == {"p50": 0, "p99": 0, "p999": 0, "max": 0}
    latencies.add(0.0)
    latencies.add(1e9)
    assert latencies.summary().max == 1e9

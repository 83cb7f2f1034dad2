import os
import subprocess
import sys

import numpy as np
import pytest
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.soak.limits import Sample, growth, sample


def life(slope_mb_per_h: float, noise_mb: float = 0.0, minutes: float = 20.0) -> list[Sample]:
    rng = np.random.default_rng(0)
    times = np.arange(0.0, 60.0 * minutes, 2.0)
    return [
        Sample(t, 1, 120.0 + slope_mb_per_h * t / 3600.0 + rng.normal(0, noise_mb), 30, 20)
        for t in times
    ]


@pytest.mark.parametrize("slope", [0.0, 12.0, 100.0, -5.0])
def test_a_slope_is_found_under_noise(slope: float) -> None:
    assert growth(life(slope)).memory_mb_per_h == pytest.approx(slope, abs=1e-6)
    assert growth(life(slope, noise_mb=0.5)).memory_mb_per_h == pytest.approx(slope, abs=12.0)


def test_a_few_wild_samples_change_nothing() -> None:
    samples = life(10.0)
    for k in range(0, len(samples), 10):
        samples[k] = samples[k]._replace(rss_mb=400.0)
    assert growth(samples).memory_mb_per_h == pytest.approx(10.0, abs=2.0)


def test_a_saw_tooth_is_no_growth() -> None:
    samples = [s._replace(rss_mb=120.0 + 0.1 * (s.time_s % 60.0)) for s in life(0.0)]
    assert abs(growth(samples).memory_mb_per_h) < 3.0


def test_handles_count_if_they_stay_open() -> None:
    samples = life(0.0)
    short = [s._replace(files=35 if 500 < s.time_s < 510 else 30) for s in samples]
    leak = [
        s._replace(files=30 + int(s.time_s / 60), threads=20 + int(s.time_s / 300)) for s in samples
    ]
    assert growth(short).files == 0
    assert growth(leak).files == 17
    assert growth(leak).threads == 3


def test_too_little_is_no_growth() -> None:
    assert growth([]).memory_mb_per_h == 0.0
    assert growth(life(100.0)[:1]).memory_mb == 0.0


def test_a_process_is_looked_at() -> None:
    taken = sample(3.0, os.getpid())
    assert taken is not None
    assert taken.rss_mb > 10.0
    assert taken.files >= 3
    assert taken.threads >= 1


def test_a_process_that_is_gone_gives_no_sample() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    assert wait_until(lambda: sample(0.0, gone.pid) is None)

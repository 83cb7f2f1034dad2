"""The ratios of one run hold on any machine, however busy."""

import pytest

from twinscrew.hil_sim.bench.latency import clouds, segment_ratio

SCANS = 8


@pytest.mark.parametrize("density", ["sparse", "30k", "70k"])
def test_the_kernel_labels_range_images_many_times_faster_than_numpy(density: str) -> None:
    assert segment_ratio(clouds()[density][:SCANS]) > 8.0

"""A place that is held, and a berth that is come to, are decided again bit for bit."""

import pytest

from twinscrew.hil_sim.experiments.station import BerthTask, HoldTask, sail_berth, sail_hold
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.vessel.replay import combined_sha256, replay


@pytest.mark.slow
@pytest.mark.parametrize("what", ["hold", "berth"])
def test_a_recorded_task_is_decided_as_before(what, tmp_path):
    if what == "hold":
        record = sail_hold(HoldTask(vessel="heron", settle_s=5.0, duration_s=10.0), tmp_path)
    else:
        record = sail_berth(BerthTask(vessel="heron", duration_s=45.0), tmp_path)
    (recording,) = find_recordings(tmp_path)
    again = replay(recording)
    assert combined_sha256([again.sha256]) == record.decisions_sha256


@pytest.mark.slow
def test_two_runs_of_one_seed_are_the_same_and_the_heron_lies_alongside():
    task = BerthTask(vessel="heron", duration_s=120.0)
    first = sail_berth(task)
    assert first == sail_berth(task)
    assert first.berthed
    assert first.speed_mps <= 0.2


@pytest.mark.slow
def test_the_heron_holds_its_place_in_wind_waves_and_half_a_metre_a_second():
    record = sail_hold(HoldTask(vessel="heron", settle_s=45.0, duration_s=60.0))
    assert record.held
    assert record.vrx_score < 1.0

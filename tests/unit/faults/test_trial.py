import os
import subprocess
import sys

import numpy as np

from twinscrew.hil_sim.drivers.processes import FIFO, is_punctual, ordinary, punctual
from twinscrew.hil_sim.faults.plan import load_plan
from twinscrew.hil_sim.faults.trial import groups
from twinscrew.hil_sim.faults.waters import BUOY_ASIDE_M, LANE_M, lanes
from twinscrew.runtime.perception.segmentation import PerceptionSettings


def test_what_concerns_the_machine_is_tried_alone_and_the_rest_together() -> None:
    names = ("lidar_drop", "cpu_hog", "pilot_hold", "runtime_killed", "disarmed", "clock_back")
    made = [[plan.name for plan in batch] for batch in groups(map(load_plan, names), 2)]
    assert made[0] == ["cpu_hog"]
    assert [len(batch) for batch in made[1:]] == [2, 2, 1]
    assert made[-1] == ["runtime_killed"]  # the longest with the longest


def test_no_vessel_sees_what_happens_in_another_lane() -> None:
    scenario = lanes(3, 30.0)
    reach_m = PerceptionSettings().max_range_m
    apart = np.diff(scenario.starts[:, 1])
    assert (apart - BUOY_ASIDE_M > reach_m).all()
    assert apart.tolist() == [LANE_M, LANE_M]
    east = scenario.buoys[:, 1] - np.repeat(scenario.starts[:, 1], len(scenario.buoys) // 3)
    assert (np.abs(east) == BUOY_ASIDE_M).all()


def test_a_simulator_is_punctual_for_a_while_and_then_as_before() -> None:
    before = os.sched_getscheduler(0)
    with punctual():
        inside = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
        with ordinary():
            assert not is_punctual()
            child = [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"]
            started = subprocess.run(child, capture_output=True, text=True, check=True)
        assert inside == (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)
    assert int(started.stdout) == os.SCHED_OTHER
    assert inside in ((os.SCHED_FIFO, FIFO), (before, 0))
    assert os.sched_getscheduler(0) == before

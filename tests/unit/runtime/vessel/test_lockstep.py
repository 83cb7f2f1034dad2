"""A vessel in simulated time does what it does on the boat."""

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.boat import EPOCH_NS, cloud, odometry

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.runtime.link.ardupilot.link import AutopilotSettings
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.vessel.config import RuntimeConfig
from twinscrew.runtime.vessel.lockstep import SteppedRuntime

CONFIG = RuntimeConfig(
    sensor="vrx16",
    policy="apf",
    autopilot=AutopilotSettings(arm=True, receiver_fitted=False, check_parameters=False),
)


def test_a_ground_station_gives_a_goal_in_lock_step_too_and_the_vessel_heads_for_it() -> None:
    runtime, station = SteppedRuntime(CONFIG, epoch_ns=EPOCH_NS), Wire(255, 190)
    pilot, ear = RoverAutopilot(RoverAutopilotSettings(), 1), Wire(9, 9)
    told = []
    for k in range(80):
        now_s = round(0.05 * k, 6)
        true = odometry(now_s, north=0.001 * k)
        runtime.deliver("odometry", cdr.encode_odometry(true), now_s)
        if k % 2 == 0:
            scan = cdr.encode_point_cloud(cloud(now_s))
            pilot.receive(runtime.deliver("points", scan, now_s), now_s)
        said = pilot.step(now_s, true)
        if k == 30:
            goal = mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 191, 1, 0b110111111000, 40.0, 5.0, 0, 0, 0, 0, 0, 0, 0, 0, 0
            )
            assert not pilot.thrust_command_N().any()
            said += station.encode(goal)
        answer = runtime.exchange(said, now_s)
        told += [m.text for m in ear.decode(answer) if m.get_type() == "STATUSTEXT"]
        pilot.receive(answer, now_s)
    target = runtime.vessel.pipeline.mission.target
    assert target is not None
    np.testing.assert_allclose(target.position_N, (40.0, 5.0))
    assert pilot.thrust_command_N().all()
    assert any("goal" in text for text in told)
    runtime.close()

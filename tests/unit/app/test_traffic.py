"""`doctor --listen`: what it says of each thing that comes, or does not."""

import numpy as np
import pytest
from tests.harness.boat import cloud, odometry

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.app import traffic
from twinscrew.runtime.app.checks import Verdict
from twinscrew.runtime.app.config import RuntimeConfig
from twinscrew.runtime.geometry.frames import quaternion_from_euler
from twinscrew.runtime.link.autopilot import AutopilotSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Odometry

VRX16 = RuntimeConfig(sensor="vrx16")


@pytest.mark.parametrize(("rate_hz", "verdict"), [(0.0, "FAIL"), (5.0, "WARN"), (9.8, "OK")])
def test_a_topic_that_is_slow_is_a_warning_and_one_that_is_missing_a_failure(
    rate_hz: float, verdict: str
) -> None:
    assert traffic._rate("points", rate_hz).verdict.value == verdict


def test_scans_of_the_described_sensor_fit_and_those_of_another_fail() -> None:
    world = make_world(load_scenario("passage"), sensor="vrx16")
    newest = {"points": cdr.encode_point_cloud(world.cloud(0))}
    assert traffic._layout(newest, VRX16).verdict is Verdict.OK
    turned = world.cloud(0).points_S[:, [2, 0, 1]]
    newest = {"points": cdr.encode_point_cloud(cloud(0.0, turned))}
    found = traffic._layout(newest, VRX16)
    assert found.verdict is Verdict.FAIL
    assert "description" in found.advice


@pytest.mark.parametrize(
    ("newest", "words"), [({}, "nothing came"), ({"points": b"\x00\x01"}, "PointCloud2")]
)
def test_no_cloud_or_a_malformed_one_fails(newest: dict[str, bytes], words: str) -> None:
    found = traffic._layout(newest, VRX16)
    assert found.verdict is Verdict.FAIL
    assert words in found.found


@pytest.mark.parametrize(("roll", "verdict"), [(0.1, Verdict.OK), (np.pi / 2, Verdict.FAIL)])
def test_a_boat_that_lies_on_its_side_has_its_frames_mixed_up(
    roll: float, verdict: Verdict
) -> None:
    level = odometry(0.0)
    tilted = Odometry(
        stamp_ns=level.stamp_ns,
        position_N=level.position_N,
        q_NB=quaternion_from_euler(roll, 0.0, 1.0),
        velocity_B=np.array([1.5, 0.0, 0.0]),
        rates_B=level.rates_B,
    )
    found = traffic._sense({"odometry": cdr.encode_odometry(tilted)}, VRX16)
    assert found.verdict is verdict
    assert "heading 57 deg" in found.found
    assert "1.5 m/s" in found.found


def test_where_nothing_comes_every_line_fails_and_says_what_to_look_at() -> None:
    bus = RuntimeConfig().bus
    silent = RuntimeConfig(
        bus=type(bus)(connect=()), autopilot=AutopilotSettings(connection="udpin:127.0.0.1:0")
    )
    findings = traffic.listen(silent, 0.2)
    assert {f.what for f in findings} >= {"points", "odometry", "cloud and sensor", "autopilot"}
    assert all(f.verdict is Verdict.FAIL and f.advice for f in findings)

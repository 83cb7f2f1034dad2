"""What the doctor says of what comes, or does not."""

import numpy as np
import pytest
from tests.harness.boat import cloud, odometry

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.world import make_world
from twinscrew.runtime.doctor import listening as heard
from twinscrew.runtime.doctor.checks import Verdict
from twinscrew.runtime.doctor.listening import Heard
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Odometry
from twinscrew.runtime.vessel.config import RuntimeConfig

VRX16 = RuntimeConfig(sensor="vrx16")


def came(rate_hz: float, seconds: float = 2.0, age_s: float = 0.05) -> list[Heard]:
    return [Heard(b"", i / rate_hz, age_s) for i in range(int(rate_hz * seconds))]


@pytest.mark.parametrize(("rate_hz", "verdict"), [(0.0, "FAIL"), (5.0, "WARN"), (10.0, "OK")])
def test_a_topic_that_is_slow_is_a_warning_and_one_that_is_missing_a_failure(
    rate_hz: float, verdict: str
) -> None:
    messages = came(rate_hz) if rate_hz else []
    assert heard.judge_rate("points", messages, 2.0).verdict.value == verdict


def test_a_topic_that_falls_silent_for_too_long_is_a_warning() -> None:
    messages = came(20.0)
    del messages[10:18]
    found = heard.judge_rate("odometry", messages, 2.0)
    assert found.verdict is Verdict.WARN
    assert "longest silence 0.45 s" in found.found


def test_the_age_of_messages_is_told_unless_they_are_stamped_by_another_clock() -> None:
    assert "age 50 ms" in heard.judge_rate("points", came(10.0), 2.0).found
    assert "age" not in heard.judge_rate("points", came(10.0, age_s=1e9), 2.0).found


@pytest.mark.parametrize(
    ("scans_s", "odometry_s", "verdict"),
    [
        (0.08, 0.01, "OK"),
        (0.5, 0.01, "WARN"),
        (1.7e9, 0.01, "FAIL"),
        (1.7e9, 1.7e9, "OK"),  # both simulated: they agree
    ],
)
def test_scans_and_odometry_must_be_stamped_by_one_clock(
    scans_s: float, odometry_s: float, verdict: str
) -> None:
    both = {"points": came(10.0, age_s=scans_s), "odometry": came(20.0, age_s=odometry_s)}
    assert heard.judge_clocks(both).verdict.value == verdict


def test_scans_of_the_described_sensor_fit_and_those_of_another_fail() -> None:
    world = make_world(load_scenario("passage"), sensor="vrx16")
    newest = {"points": cdr.encode_point_cloud(world.cloud(0))}
    assert heard.judge_layout(newest, VRX16).verdict is Verdict.OK
    turned = world.cloud(0).points_S[:, [2, 0, 1]]
    newest = {"points": cdr.encode_point_cloud(cloud(0.0, turned))}
    found = heard.judge_layout(newest, VRX16)
    assert found.verdict is Verdict.FAIL
    assert "description" in found.advice


@pytest.mark.parametrize(
    ("newest", "words"), [({}, "nothing came"), ({"points": b"\x00\x01"}, "PointCloud2")]
)
def test_no_cloud_or_a_malformed_one_fails(newest: dict[str, bytes], words: str) -> None:
    found = heard.judge_layout(newest, VRX16)
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
    found = heard.judge_attitude({"odometry": cdr.encode_odometry(tilted)})
    assert found.verdict is verdict
    assert "heading 57 deg" in found.found
    assert "1.5 m/s" in found.found

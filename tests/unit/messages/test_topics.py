import re
from pathlib import Path

import pytest

from twinscrew.runtime.errors import BusError
from twinscrew.runtime.messages.topics import CORE_INPUTS, TOPICS, key, ros_name, type_hash
from twinscrew.runtime.messages.types import Severity
from twinscrew.runtime.safety.events import KINDS
from twinscrew.runtime.vessel.config import RuntimeConfig, inputs_of

ROOT = Path(__file__).parents[3]


def test_the_core_takes_in_what_decides_a_run():
    always = {"points", "odometry", "goal", "route", "hold", "berth"}
    always |= {"engagement", "fallback", "chart"}
    assert set(CORE_INPUTS) == always | {"nmea", "radar"}


def test_every_topic_is_listed_under_its_own_name_and_key():
    assert all(name == topic.name for name, topic in TOPICS.items())
    assert len({topic.key for topic in TOPICS.values()}) == len(TOPICS)


def test_the_default_keys_are_the_ros_names_that_vrx_uses():
    points, clock = TOPICS["points"], TOPICS["clock"]
    assert key(points, "wamv") == "wamv/sensors/lidars/lidar_wamv_sensor/points"
    assert key(TOPICS["thrust_left"], "wamv") == "wamv/thrusters/left/thrust"
    assert key(clock, "wamv") == "clock"
    assert ros_name(clock, "wamv") == "/clock"


def test_rmw_zenoh_keys_have_domain_name_type_and_hash():
    name = key(TOPICS["thrust_left"], "wamv1", "rmw_zenoh", domain=7)
    type_ = f"std_msgs::msg::dds_::Float64_/{type_hash('std_msgs/msg/Float64')}"
    assert name == f"7/wamv1/thrusters/left/thrust/{type_}"


def test_the_keys_of_humbles_rmw_zenoh_have_no_hashes():
    name = key(TOPICS["thrust_left"], "wamv1", "rmw_zenoh_humble", domain=7)
    type_ = "std_msgs::msg::dds_::Float64_/TypeHashNotSupported"
    assert name == f"7/wamv1/thrusters/left/thrust/{type_}"


@pytest.mark.parametrize("namespace", ["", "/wamv", "wamv/", "a b", "1boat", "a//b", "wamv/**"])
def test_a_namespace_that_ros_does_not_allow_is_refused(namespace):
    with pytest.raises(BusError, match="is not a namespace"):
        key(TOPICS["goal"], namespace)


def test_a_format_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(BusError, match="'dds' is not one of 'ros2dds', 'rmw_zenoh'"):
        key(TOPICS["goal"], "wamv", "dds")


def test_an_input_with_a_rate_goes_stale_within_half_a_second():
    for topic in TOPICS.values():
        if topic.core and topic.rate_hz:
            assert 1 / topic.rate_hz < topic.max_age_s < 0.5


def test_the_documented_table_is_this_table():
    text = (ROOT / "docs" / "interfaces.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| `([^`]+)` \| `([^`]+)` \|(.*)\|$", text, re.MULTILINE)
    documented = {name: (key_, type_, rest.split("|")) for name, key_, type_, rest in rows}
    assert list(documented) == list(TOPICS)
    for topic in TOPICS.values():
        key_, type_, (direction, rate, age, core) = documented[topic.name]
        assert (key_, type_) == (topic.key, topic.ros_type.replace("/msg/", "/"))
        assert direction.strip() == topic.direction.value
        assert rate.strip() == (f"{topic.rate_hz:g}" if topic.rate_hz else "on change")
        assert age.strip() == (f"{topic.max_age_s:g}" if topic.max_age_s else "never")
        assert core.strip() == ("yes" if topic.core else "no")


def test_what_is_watched_is_always_an_input_and_has_an_event_and_an_age():
    watched = [topic for topic in TOPICS.values() if topic.stale]
    assert {topic.name for topic in watched} == {"points", "odometry"}
    for topic in watched:
        assert topic.taken
        assert topic.max_age_s
        assert KINDS[topic.stale].severity is Severity.ERROR


@pytest.mark.parametrize("source", ["bus", "gps_imu", "autopilot"])
def test_a_runtime_listens_to_what_the_table_says(source):
    told = {"bus": {"odometry"}, "gps_imu": {"gps", "imu"}, "autopilot": set()}[source]
    assert (
        set(inputs_of(RuntimeConfig(odometry_source=source)))
        == {"points", "goal", "route", "hold", "berth"} | told
    )

"""Liveliness tokens, as rmw_zenoh and zenoh-bridge-ros2dds write and read them."""

from dataclasses import replace

import pytest
import zenoh

from twinscrew.runtime.bus.zenoh import End, dds_end, rmw_end, rmw_node
from twinscrew.runtime.messages.topics import TOPICS

SESSION = "aac3178e146ba6f1fc6e6a4085e77f21"
THRUST = TOPICS["thrust_left"]
HASH = "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a"
"""Of std_msgs/msg/Float64 in ROS 2 Jazzy."""


def test_a_node_is_told_as_rmw_zenohs_design_shows_it():
    expected = f"@ros2_lv/2/{SESSION}/0/0/NN/%/%/listener"
    assert rmw_node(SESSION, 2, "", "listener") == expected
    assert rmw_node(SESSION, 2, "wamv1", "twinscrew").endswith("/NN/%/%wamv1/twinscrew")


def test_a_publisher_is_told_with_its_topic_type_hash_and_quality():
    topic = replace(THRUST, depth=7)
    assert rmw_end(SESSION, 0, "wamv1", "twinscrew", 10, End.PUBLISHER, topic) == (
        f"@ros2_lv/0/{SESSION}/0/10/MP/%/%wamv1/twinscrew/%wamv1%thrusters%left%thrust/"
        f"std_msgs::msg::dds_::Float64_/{HASH}/::,7:,:,:,,"
    )


def test_humbles_tokens_have_no_hashes_and_static_transforms_reach_late_listeners():
    static = TOPICS["static_transforms"]
    token = rmw_end(SESSION, 0, "w", "n", 2, End.PUBLISHER, static, "rmw_zenoh_humble")
    assert token.endswith("tf2_msgs::msg::dds_::TFMessage_/TypeHashNotSupported/:1:,1:,:,:,,")
    assert dds_end(SESSION, "w", End.PUBLISHER, static).endswith("/:1:1:0,1")


def test_a_topic_outside_the_namespace_keeps_its_name():
    token = rmw_end(SESSION, 0, "wamv1", "twinscrew", 3, End.SUBSCRIBER, TOPICS["clock"])
    assert "/MS/%/%wamv1/twinscrew/%clock/rosgraph_msgs::msg::dds_::Clock_/" in token


def test_the_bridge_is_told_name_type_and_quality():
    topic = replace(THRUST, depth=10)
    assert dds_end(SESSION, "wamv1", End.PUBLISHER, topic) == (
        f"@/{SESSION}/@ros2_lv/MP/wamv1§thrusters§left§thrust/std_msgs§msg§Float64/:1:0:0,10"
    )
    assert "/MS/" in dds_end(SESSION, "wamv1", End.SUBSCRIBER, topic)


@pytest.mark.parametrize("topic", TOPICS.values(), ids=lambda topic: topic.name)
@pytest.mark.parametrize("end", End)
def test_tokens_are_keys_that_zenoh_takes(topic, end):
    tokens = [
        rmw_end(SESSION, 0, "fleet/wamv1", "twinscrew", 4, end, topic),
        dds_end(SESSION, "fleet/wamv1", end, topic),
    ]
    for token in tokens:
        assert str(zenoh.KeyExpr(token)) == token
    assert len(tokens[0].split("/")) == 13
    assert len(tokens[1].split("/")) == 7

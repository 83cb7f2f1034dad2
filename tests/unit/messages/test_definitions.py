"""The definitions that recordings hold, against bytes that were made without them."""

from pathlib import Path

import pytest

from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import OWN, TOPICS, definition, type_hash, type_store

GOLDEN = Path(__file__).parents[2] / "data" / "cdr"
TYPES = {
    "odometry": TOPICS["odometry"].ros_type,
    "goal": TOPICS["goal"].ros_type,
    "point_cloud": TOPICS["points"].ros_type,
    "thrust": TOPICS["thrust_left"].ros_type,
    "clock": TOPICS["clock"].ros_type,
    "engagement": TOPICS["engagement"].ros_type,
    "diagnostics": TOPICS["diagnostics"].ros_type,
    "object_markers": TOPICS["objects"].ros_type,
    "decision": TOPICS["decision"].ros_type,
}


@pytest.mark.parametrize("name", TYPES)
def test_a_tool_that_knows_the_definition_reads_and_writes_the_same_bytes(name):
    payload = (GOLDEN / f"{name}.cdr").read_bytes()
    message = type_store().deserialize_cdr(payload, TYPES[name])
    assert bytes(type_store().serialize_cdr(message, TYPES[name])) == payload


def test_a_tool_that_knows_the_definition_finds_every_field_of_a_decision():
    payload = (GOLDEN / "decision.cdr").read_bytes()
    ours = cdr.decode_decision(payload)
    theirs = type_store().deserialize_cdr(payload, TYPES["decision"])
    assert theirs.sequence == ours.sequence
    assert theirs.acted == ours.acted
    assert theirs.arrived == ours.arrived
    assert theirs.thrust.tolist() == ours.thrust.tolist()
    assert theirs.observation.ego.tolist() == ours.observation.ego.tolist()
    assert theirs.tracks.covariance.tolist() == ours.tracks.covariance.ravel().tolist()
    assert theirs.events[0].name == ours.events[0].name


def test_every_topic_has_a_definition_and_a_hash():
    for topic in TOPICS.values():
        assert definition(topic.ros_type)
        assert type_hash(topic.ros_type).startswith("RIHS01_")


def test_the_hash_is_the_one_that_rmw_zenoh_documents_for_a_string():
    expected = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert type_hash("std_msgs/msg/String") == expected


def test_our_own_types_are_complete_within_their_definitions():
    text = definition("twinscrew_msgs/msg/Decision")
    parts = {"Observation", "Objects", "Tracks", "HealthEvent"}
    assert all(f"MSG: twinscrew_msgs/{part}" in text for part in parts)
    assert all(name.startswith("twinscrew_msgs/msg/") for name in OWN)


def test_an_unknown_type_is_refused_by_name():
    with pytest.raises(MessageError, match="no definition of the ROS type 'a/msg/B'"):
        definition("a/msg/B")

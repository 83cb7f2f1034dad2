"""Liveliness tokens: what makes `ros2 topic list` show what we publish and hear.

Two kinds for the two key formats. rmw_zenoh builds the whole graph of ROS 2 out of tokens (its
docs/design.md, "Graph Cache"). zenoh-bridge-ros2dds makes a DDS writer or reader for what other
sessions announce (its liveliness_mgt.rs, 1.x). Messages flow without them.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from twinscrew.runtime.messages.definitions import type_hash
from twinscrew.runtime.messages.topics import Topic, ros_name

_EMPTY: Final = "%"
_SLASH_RMW, _SLASH_DDS = "%", "§"
_RELIABLE, _VOLATILE, _KEEP_LAST = 1, 0, 0
"""DDS's numbers."""
NODE_ID: Final = 0
"""[-] We are one node a session and namespace, and rmw_zenoh counts nodes and entities together."""


class End(Enum):
    """Which end of a topic we are."""

    PUBLISHER = "MP"
    SUBSCRIBER = "MS"


def rmw_node(session: str, domain: int, namespace: str, node: str) -> str:
    """Give rmw_zenoh's token of a node.

    Parameters
    ----------
    session
        The Zenoh session's identity, hexadecimal.
    domain
        [-] ROS_DOMAIN_ID.
    namespace, node
        The node's namespace, without a leading slash, and name.
    """
    return _rmw(session, domain, NODE_ID, "NN", namespace, node)


def rmw_end(
    session: str, domain: int, namespace: str, node: str, number: int, end: End, topic: Topic
) -> str:
    """Give rmw_zenoh's token of a publisher or subscriber; `number` is its own in the session."""
    package, _, last = topic.ros_type.split("/")
    name = ros_name(topic, namespace).replace("/", _SLASH_RMW)
    quality = f"::,{topic.depth}:,:,:,,"  # reliable, volatile, keep the last `depth`: the defaults
    entity = _rmw(session, domain, number, end.value, namespace, node)
    type_ = f"{package}::msg::dds_::{last}_/{type_hash(topic.ros_type)}"
    return f"{entity}/{name}/{type_}/{quality}"


def dds_end(session: str, namespace: str, end: End, topic: Topic) -> str:
    """Give zenoh-bridge-ros2dds's token of a publisher or subscriber."""
    name = ros_name(topic, namespace).removeprefix("/").replace("/", _SLASH_DDS)
    type_ = topic.ros_type.replace("/", _SLASH_DDS)
    quality = f":{_RELIABLE}:{_VOLATILE}:{_KEEP_LAST},{topic.depth}"
    return f"@/{session}/@ros2_lv/{end.value}/{name}/{type_}/{quality}"


def _rmw(session: str, domain: int, number: int, kind: str, namespace: str, node: str) -> str:
    where = f"/{namespace}".replace("/", _SLASH_RMW) if namespace else _EMPTY
    enclave = _EMPTY
    return f"@ros2_lv/{domain}/{session}/{NODE_ID}/{number}/{kind}/{enclave}/{where}/{node}"

"""What rosbag2 wants to know of a bag: the content of its `metadata.yaml`, version 9."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from twinscrew.runtime.messages.topics import TOPICS, type_hash


@dataclass(slots=True)
class FileContents:
    """What is in one file of a bag."""

    name: str
    """Its name within the bag's folder."""
    counts: Counter[str] = field(default_factory=Counter)
    """Messages of each topic."""
    first_ns: int = 0
    last_ns: int = 0
    """[ns] Times of its first and last message."""


def metadata_yaml(
    files: Sequence[FileContents], names: Mapping[str, str], custom: Mapping[str, str]
) -> str:
    """Give the text of `metadata.yaml`: JSON, which is YAML.

    Parameters
    ----------
    files
        At least one, in the order of their times.
    names
        The ROS names of the topics.
    custom
        What else to say.
    """
    whole = FileContents(
        name="",
        counts=sum((file.counts for file in files), Counter()),
        first_ns=files[0].first_ns,
        last_ns=files[-1].last_ns,
    )
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        "relative_file_paths": [file.name for file in files],
        **_span(whole),
        "topics_with_message_count": [
            {"topic_metadata": _topic(topic, names[topic]), "message_count": count}
            for topic, count in whole.counts.items()
        ],
        "compression_format": "",  # chunks are compressed within MCAP, not by rosbag2
        "compression_mode": "",
        "files": [{"path": file.name, **_span(file)} for file in files],
        "custom_data": dict(custom),
        "ros_distro": "jazzy",
    }
    return json.dumps({"rosbag2_bagfile_information": information}, indent=1) + "\n"


def _span(file: FileContents) -> dict[str, Any]:
    return {
        "starting_time": {"nanoseconds_since_epoch": file.first_ns},
        "duration": {"nanoseconds": file.last_ns - file.first_ns},
        "message_count": file.counts.total(),
    }


def _topic(topic: str, name: str) -> dict[str, Any]:
    ros_type = TOPICS[topic].ros_type
    return {
        "name": name,
        "type": ros_type,
        "serialization_format": "cdr",
        "offered_qos_profiles": [],
        "type_description_hash": type_hash(ros_type),
    }

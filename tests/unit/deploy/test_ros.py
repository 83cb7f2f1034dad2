"""What lies in deploy/ros is what the runtime publishes: messages, names, types, layouts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from ruamel.yaml import YAML

from twinscrew.runtime.messages.topics import OWN, TOPICS, ros_name, type_hash, type_store

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "deploy" / "ros" / "twinscrew_msgs"
FILES = sorted((PACKAGE / "msg").glob("*.msg"))


def test_the_package_has_every_message_of_the_runtime_and_builds_each() -> None:
    names = {name.rpartition("/")[2] for name in OWN}
    assert {file.stem for file in FILES} == names
    cmake = (PACKAGE / "CMakeLists.txt").read_text()
    assert set(re.findall(r'"msg/(\w+)\.msg"', cmake)) == names


def test_its_files_describe_the_very_types_that_are_on_the_bus() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    found = {}
    for file in FILES:
        found |= get_types_from_msg(file.read_text(), f"twinscrew_msgs/msg/{file.stem}")
    store.register(found)
    for name, text in OWN.items():
        file = PACKAGE / "msg" / f"{name.rpartition('/')[2]}.msg"
        assert file.read_text() == text.lstrip("\n")  # words and units are meant, too
        assert store.hash_rihs01(name) == type_hash(name)


def test_its_manifest_says_what_ros_asks_for() -> None:
    manifest = ET.parse(PACKAGE / "package.xml").getroot()  # noqa: S314  (our own file)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert manifest.get("format") == "3"
    assert manifest.findtext("name") == "twinscrew_msgs"
    assert manifest.findtext("version") == project["version"]
    assert manifest.findtext("license") == project["license"]
    assert manifest.findtext("member_of_group") == "rosidl_interface_packages"
    assert manifest.findtext("buildtool_depend") == "ament_cmake"


@pytest.mark.skipif(shutil.which("rosidl") is None, reason="ROS 2's rosidl is not installed")
def test_ros_2s_own_tool_takes_them(tmp_path: Path) -> None:
    words = ["rosidl", "translate", "-o", str(tmp_path), "--to", "idl", "twinscrew_msgs"]
    files = [str(file.relative_to(PACKAGE)) for file in FILES]
    done = subprocess.run([*words, *files], cwd=PACKAGE, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert {path.stem for path in tmp_path.rglob("*.idl")} == {file.stem for file in FILES}


# -- Layouts: what they show exists, under the name of VRX's boat.

LAYOUTS = ROOT / "deploy" / "ros"
NAMES = {ros_name(topic, "wamv"): topic.ros_type for topic in TOPICS.values()}
DRAWS = {
    "rviz_default_plugins/PointCloud2": "sensor_msgs/msg/PointCloud2",
    "rviz_default_plugins/Odometry": "nav_msgs/msg/Odometry",
    "rviz_default_plugins/MarkerArray": "visualization_msgs/msg/MarkerArray",
    "rviz_default_plugins/Path": "nav_msgs/msg/Path",
    "rviz_default_plugins/SetGoal": "geometry_msgs/msg/PoseStamped",
}
"""What RViz's plugins draw, or send."""
SHOWN_3D = (*DRAWS.values(), "sensor_msgs/msg/NavSatFix")


def fields(ros_type: str, path: str) -> None:
    """Follow a path of fields, as "thrust[0]"; fail where there is none."""
    for part in path.split("."):
        name, _, index = part.partition("[")
        found = dict(type_store().fielddefs[ros_type][1])
        assert name in found, f"{ros_type} has no {name}"
        kind, what = found[name]
        assert bool(index) == (kind in (Nodetype.ARRAY, Nodetype.SEQUENCE)), part
        ros_type = what[0] if kind is not Nodetype.NAME else what
        ros_type = ros_type if isinstance(ros_type, str) else ros_type[0]


def test_what_rviz_draws_and_sends_exists_with_the_type_of_its_plugin() -> None:
    rviz = YAML(typ="safe").load((LAYOUTS / "twinscrew.rviz").read_text())
    manager = rviz["Visualization Manager"]
    parts = [part for part in (*manager["Displays"], *manager["Tools"]) if "Topic" in part]
    assert {part["Class"] for part in parts} == set(DRAWS)
    for part in parts:
        assert NAMES[part["Topic"]["Value"]] == DRAWS[part["Class"]]


def test_what_foxglove_shows_exists_down_to_the_fields_of_its_plots() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    panels = layout["configById"]
    (scene,) = (panels[name] for name in panels if name.startswith("3D!"))
    assert all(NAMES[topic] in SHOWN_3D for topic in scene["topics"])
    assert NAMES[scene["publish"]["poseTopic"]] == "geometry_msgs/msg/PoseStamped"
    paths = [
        line["value"] for name in panels if "Plot!" in name for line in panels[name]["paths"]
    ] + [panels[name]["topicPath"] for name in panels if "RawMessages!" in name]
    assert len(paths) == 8
    for path in paths:
        topic = max((name for name in NAMES if path.startswith(f"{name}.")), key=len)
        fields(NAMES[topic], path.removeprefix(f"{topic}."))
    (health,) = (panels[name] for name in panels if "Diagnostic" in name)
    assert NAMES[health["topicToRender"]] == "diagnostic_msgs/msg/DiagnosticArray"
    shown = re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))
    assert sorted(shown) == sorted(panels)

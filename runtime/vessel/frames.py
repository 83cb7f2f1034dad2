"""The frames of one vessel: what they are called, where they are, and goals given in any of them.

Every vessel has one tree. Its edges are the odometry (from the world's frame to the vessel's, at
its stamp), the LiDAR's place on the vessel, and the static transforms of the settings::

    map --[frames] static--> odom --odometry--> wamv1/base_link --mount--> wamv1/lidar

The names come from the messages: whatever the odometry and the scans call their frames. The
settings name what no message names.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Annotated, Final

import numpy as np
from msgspec import Meta

from twinscrew.runtime.errors import TwinscrewError
from twinscrew.runtime.geometry import (
    Array,
    flu_to_frd,
    quaternion_from_euler,
    rotation_from_quaternion,
)
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import WORLD_FRAME
from twinscrew.runtime.messages.types import Float64, Odometry
from twinscrew.runtime.messages.visual import Transform, vessel_transform
from twinscrew.runtime.messages.wire import LONGEST_NAME
from twinscrew.runtime.perception.sensor import Sensor
from twinscrew.runtime.settings import Settings

FrameName = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
STATIC_EVERY_NS: Final = 1_000_000_000
"""[ns] How often the transforms that do not change are given again, for who begins to listen."""


class StaticTransform(Settings, frozen=True, kw_only=True):
    """Where a frame lies in its parent for good, in ROS's axes (REP 103)."""

    parent: FrameName
    child: FrameName
    x_m: float = 0.0
    """[m] Of the child's origin, in the parent's axes."""
    y_m: float = 0.0
    """[m]"""
    z_m: float = 0.0
    """[m]"""
    roll_rad: float = 0.0
    """[rad] Of the child in the parent: about x, then y, then z, all of the parent."""
    pitch_rad: float = 0.0
    """[rad]"""
    yaw_rad: float = 0.0
    """[rad]"""

    def transform(self) -> Transform:
        """Give it as ROS writes it."""
        q = quaternion_from_euler(self.roll_rad, self.pitch_rad, self.yaw_rad)
        return Transform(self.parent, self.child, (self.x_m, self.y_m, self.z_m), tuple(q.tolist()))


class FrameSettings(Settings, frozen=True, kw_only=True):
    """What the frames are called, and where those lie that no message tells."""

    world: Annotated[str, Meta(max_length=LONGEST_NAME)] = ""
    """The frame of positions, east-north-up. Empty: what the odometry calls it; "world" if it comes
    from the autopilot or a filter here, which call it nothing."""
    vessel: Annotated[str, Meta(max_length=LONGEST_NAME)] = ""
    """The vessel's frame. Empty: what the odometry calls it; else `<name>/base_link`."""
    static: tuple[StaticTransform, ...] = ()
    """Frames that do not move, as `{ parent = "map", child = "odom", x_m = 12.0 }`: goals may be
    given in them."""
    publish: bool = False
    """Publish the tree on /tf and /tf_static, too, and not only record it: where nobody else
    does."""

    def __post_init__(self) -> None:
        """Refuse what is no tree."""
        parents: dict[str, str] = {}
        for edge in self.static:
            if edge.child in parents:
                raise ValueError(f"static: {edge.child!r} has two parents: one is allowed")
            parents[edge.child] = edge.parent
        for start in parents:
            above, steps = parents.get(start), 0
            while above is not None and steps <= len(parents):
                above, steps = parents.get(above), steps + 1
            if above is not None:
                raise ValueError(f"static: {start!r} is its own ancestor: a tree is allowed")


class FrameError(TwinscrewError):
    """A place in a frame that cannot be related to the odometry's."""


class Frames:
    """Remembers the names that the messages use, and knows where one frame is in another.

    Parameters
    ----------
    settings
        What no message tells.
    name
        The vessel's namespace.
    sensor
        The LiDAR, at its place on the vessel; None: it is left out.
    """

    def __init__(
        self, settings: FrameSettings | None = None, name: str = "", sensor: Sensor | None = None
    ) -> None:
        self.settings = settings or FrameSettings()
        self._own = f"{name}/base_link" if name else "base_link"
        self._sensor = sensor
        self._world = self._vessel = self._lidar = ""
        self._follows = False
        self._static_ns: int | None = None

    @property
    def world(self) -> str:
        """What the frame of positions is called."""
        return self.settings.world or self._world or WORLD_FRAME

    @property
    def vessel(self) -> str:
        """What the vessel's frame is called."""
        return self.settings.vessel or self._vessel or self._own

    def follow(self, odometry: Odometry) -> bool:
        """Note what odometry calls its frames; tell whether it called N otherwise before."""
        before, self._world = self._world, odometry.frame_id
        self._vessel = odometry.child_frame_id
        is_first, self._follows = not self._follows, True
        return not is_first and before != self._world

    def see(self, lidar: str) -> None:
        """Note what the LiDAR calls its frame."""
        self._lidar = lidar

    def is_world(self, frame_id: str) -> bool:
        """Tell whether a name is that of the frame of positions; an empty one is."""
        return frame_id in ("", self.world, self._world)

    def places_N(
        self,
        frame_ids: Sequence[str],
        places: Float64,
        stamp_ns: int,
        odometry_at: Callable[[int], Odometry | None],
    ) -> Float64:
        """Give places of an order in N.

        Parameters
        ----------
        frame_ids
            The frames that the order names: one at most.
        places : (K, 2) float64
            [m] The y and x of each in that frame, at the height of its origin.
        stamp_ns
            [ns] The order's stamp; 0: now.
        odometry_at
            Gives the odometry at a time (0: the newest); None if there is none near it.

        Returns
        -------
        (K, 2) float64
            [m] [N] North, east.

        Raises
        ------
        FrameError
            The frame is not known, there are several, or the vessel's place was not known then.
        """
        if len(frame_ids) > 1:
            raise FrameError(f"places in several frames: {', '.join(map(repr, frame_ids))}")
        if not len(places) or all(self.is_world(frame_id) for frame_id in frame_ids):
            return places
        odometry = odometry_at(stamp_ns)
        x_wf = self._pose_in_world(frame_ids[0], odometry)
        if x_wf is None:
            raise FrameError(self._words(frame_ids[0], stamp_ns, odometry))
        points = np.column_stack([places[:, ::-1], np.zeros(len(places)), np.ones(len(places))])
        moved: Float64 = (x_wf @ points.T)[1::-1].T
        return np.ascontiguousarray(moved)

    def moving(self, odometry: Odometry) -> bytes:
        """Give the transform of the vessel, encoded."""
        return cdr.encode_transforms([self._vessel_edge(odometry)], stamp_ns=odometry.stamp_ns)

    def static(self, stamp_ns: int) -> bytes | None:
        """Give the transforms that do not change, encoded, once a second; None else."""
        edges, last_ns = self._static_edges(), self._static_ns
        if not edges or (last_ns is not None and 0 <= stamp_ns - last_ns < STATIC_EVERY_NS):
            return None
        self._static_ns = stamp_ns
        return cdr.encode_transforms(edges, stamp_ns=stamp_ns)

    # -- The tree.

    def _vessel_edge(self, odometry: Odometry) -> Transform:
        return vessel_transform(odometry, frame_id=self.world, child_frame_id=self.vessel)

    def _static_edges(self) -> list[Transform]:
        edges = [edge.transform() for edge in self.settings.static]
        mount = None if self._sensor is None else self._sensor.mount
        placed = {edge.child for edge in edges} | {self.vessel, ""}
        if self._sensor is None or mount is None or self._lidar in placed:
            return edges
        q = quaternion_from_euler(mount.roll_rad, mount.pitch_rad, mount.yaw_rad)
        x, y, z = flu_to_frd(self._sensor.mount_position_B).tolist()
        return [*edges, Transform(self.vessel, self._lidar, (x, y, z), tuple(q.tolist()))]

    def _pose_in_world(self, frame_id: str, odometry: Odometry | None) -> Array | None:
        """Give a frame's pose in the world's, (4, 4); None if nothing leads there."""
        edges = self._static_edges()
        if odometry is not None:
            edges.append(self._vessel_edge(odometry))
        same = {self._world: self.world, self._vessel: self.vessel}
        ways: dict[str, list[tuple[str, Array]]] = {}
        for edge in edges:
            x_pc = _pose(edge)
            parent, child = same.get(edge.parent, edge.parent), same.get(edge.child, edge.child)
            ways.setdefault(parent, []).append((child, x_pc))
            x_cp: Array = np.asarray(np.linalg.inv(x_pc), dtype=np.float64)
            ways.setdefault(child, []).append((parent, x_cp))
        reached, waiting = {self.world: np.eye(4)}, deque([self.world])
        while waiting:
            here = waiting.popleft()
            for there, step in ways.get(here, ()):
                if there not in reached:
                    reached[there] = reached[here] @ step
                    waiting.append(there)
        return reached.get(same.get(frame_id, frame_id))

    def _words(self, frame_id: str, stamp_ns: int, odometry: Odometry | None) -> str:
        if frame_id in (self.vessel, self._vessel, self._lidar) and odometry is None:
            return f"{frame_id!r} at {stamp_ns} ns: there is no odometry near that time"
        known = dict.fromkeys([self.world, self.vessel, self._lidar])
        known |= {n: None for edge in self.settings.static for n in (edge.parent, edge.child)}
        names = ", ".join(repr(name) for name in known if name)
        return f"{frame_id!r} is in no known place; known are {names}"


def _pose(edge: Transform) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_quaternion(np.array(edge.rotation))
    pose[:3, 3] = edge.translation
    return pose

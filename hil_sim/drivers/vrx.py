"""A stand-in of VRX: a world behind VRX's topics, with nobody aboard.

What VRX 2.3.2 publishes and hears, as its sources say: names, types, frames, rates, the layout of
its clouds, time that begins at zero. It has no autopilot and no watchdog: newtons that came last
act for ever. Messages are written by `rosbags`, not by the runtime's own code.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from twinscrew.hil_sim.drivers.voyage import VoyageResult
from twinscrew.hil_sim.scenario import Scenario
from twinscrew.hil_sim.scene import rotations
from twinscrew.hil_sim.sensors.navigation import Navigation
from twinscrew.hil_sim.supervisor import Result, Supervisor
from twinscrew.hil_sim.trajectory import TrajectoryLog
from twinscrew.hil_sim.world import World
from twinscrew.runtime.bus.base import Received
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import attitude_ned_frd_to_enu_flu, enu_to_ned, flu_to_frd
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS, type_store
from twinscrew.runtime.messages.types import (
    NANOSECONDS_PER_SECOND,
    Float64,
    Odometry,
    PointCloud,
)

STEP_S: Final = 0.01
"""[s] Between two looks at the thrusters, and two messages of /clock."""
ODOMETRY_EVERY: Final = 5
"""[-] Steps between two odometry messages: 20 Hz."""
AFTERWARDS_S: Final = 3.0
"""[s] The simulator goes on for so long after the last vessel's end: VRX does not stop either."""
WORLD: Final = "map"
"""The frame of positions (wamv_p3d.xacro)."""
POINT: Final = np.dtype(
    {
        "names": ["xyz", "intensity", "ring"],
        "formats": ["3<f4", "<f4", "<u2"],
        "offsets": [0, 16, 20],
        "itemsize": 32,
    }
)
"""A point of Gazebo's clouds: 32 bytes, aligned."""


def as_vrx_names_it(scenario: Scenario) -> Scenario:
    """Give a scenario whose only vessel is called "wamv"; several keep their numbers."""
    return replace(scenario, names=("wamv",)) if scenario.vessels == 1 else scenario


class Vrx:
    """Sensors out, newtons in."""

    def __init__(
        self,
        world: World,
        bus: ZenohBus,
        *,
        scan_s: float,
        navigation: Navigation,
        progress: Callable[[float, tuple[Result, ...]], None] | None = None,
        tell: Callable[[str], None] = print,
    ) -> None:
        """Prepare.

        Parameters
        ----------
        world
            Its time must begin at zero, and its LiDARs give organised clouds.
        scan_s
            [s] Between two scans.
        navigation
            The vessels' GPS and IMU.
        progress
            Called with the simulated time since the first thrust, and the present results.
        tell
            Told what somebody has to do.
        """
        self._world, self._navigation = world, navigation
        self._progress, self._tell = progress, tell
        self._scan_every = round(scan_s / STEP_S)
        names = world.scenario.names
        self._buses = [bus.within(name) for name in names]
        self._thrust = np.zeros((len(names), 2))
        self._odometry: list[Odometry] = []
        for vessel, own in enumerate(self._buses):
            own.subscribe("thrust_left", partial(self._take, vessel, 0))
            own.subscribe("thrust_right", partial(self._take, vessel, 1))
        self._log = TrajectoryLog()
        self._store = type_store()

    @property
    def thrust_N(self) -> Float64:
        """[N] (V, 2) What came last on the thrusters' topics: it acts until something else does."""
        return self._thrust.copy()

    def run(self, stop: Callable[[], bool] = lambda: False) -> VoyageResult:
        """Sail from the first thrust until every vessel has arrived, collided or run out of time.

        Before that it waits as long as it takes.
        """
        for i, name in enumerate(self._world.scenario.names):
            north, east = self._world.scenario.goals[i].tolist()
            topic = f"/{name}/thrusters/left/thrust"
            goal = f"x {east:g} m, y {north:g} m in {WORLD}"
            self._tell(f"{name} waits for thrust on {topic}; its goal is {goal}")
        begin_s, supervisor, ends_s = time.monotonic() - self._world.time_s, None, None
        while not stop():
            if supervisor is None and self._thrust.any():
                supervisor = Supervisor(self._world)
            self._step(supervisor)
            if supervisor is not None and supervisor.over:
                ends_s = ends_s or self._world.time_s + AFTERWARDS_S
                if self._world.time_s >= ends_s:
                    break
            time.sleep(max(0.0, begin_s + self._world.time_s - time.monotonic()))
        results = (supervisor or Supervisor(self._world)).results()
        return VoyageResult(results=results, log=self._log, duration_s=self._world.time_s)

    def _step(self, supervisor: Supervisor | None) -> None:
        world, commands = self._world, self._thrust.copy()
        if supervisor is None or supervisor.over:
            world.advance(STEP_S, commands)
        else:
            supervisor.advance(STEP_S, commands)
        self._publish(round(world.time_s / STEP_S))
        if supervisor is not None:
            self._note(supervisor)

    def _publish(self, step: int) -> None:
        world = self._world
        self._buses[0].publish("clock", cdr.encode_clock(world.stamp_ns))
        for sensed in self._navigation.take():
            self._buses[sensed.vessel].publish(sensed.topic, sensed.payload)
        for i, bus in enumerate(self._buses):
            if step % ODOMETRY_EVERY == 0:
                name = world.scenario.names[i]
                odometry = world.odometry(i)
                bus.publish("odometry", self._encoded_odometry(odometry, name))
                bus.publish("transforms", self._encoded_pose(odometry, name))
            if step % self._scan_every == 0:
                bus.publish("points", self._encoded_cloud(world.cloud(i), i))

    def _take(self, vessel: int, side: int, message: Received) -> None:
        """Take newtons, in Zenoh's thread."""
        with suppress(MessageError):
            self._thrust[vessel, side] = cdr.decode_thrust(message.payload)

    def _note(self, supervisor: Supervisor) -> None:
        elapsed_s, state = supervisor.elapsed_s, self._world.state
        if self._log.due(elapsed_s) and not supervisor.over:
            velocity_N = (rotations(state.q_NB) @ state.velocity_B[..., None])[:, :2, 0]
            pose = np.column_stack([state.position_N[:, :2], state.heading])
            ships = self._world.traffic
            traffic = None if ships is None else ships.pose_N
            self._log.add(elapsed_s, pose, velocity_N, state.thrust, traffic)
        if self._progress is not None:
            self._progress(elapsed_s, supervisor.results())

    # -- Messages as `rosbags` writes them.

    def _type(self, name: str) -> Any:
        return self._store.types[name]

    def _header(self, stamp_ns: int, frame_id: str) -> Any:
        seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS_PER_SECOND)
        stamp = self._type("builtin_interfaces/msg/Time")(seconds, nanoseconds)
        return self._type("std_msgs/msg/Header")(stamp, frame_id)

    def _pose(self, odometry: Odometry, vector: str) -> tuple[Any, Any]:
        x, y, z = enu_to_ned(odometry.position_N).tolist()
        qw, qx, qy, qz = attitude_ned_frd_to_enu_flu(odometry.q_NB).tolist()
        turn = self._type("geometry_msgs/msg/Quaternion")(qx, qy, qz, qw)
        return self._type(vector)(x, y, z), turn

    def _encoded_odometry(self, odometry: Odometry, name: str) -> bytes:
        t, unknown = self._type, np.zeros(36)
        pose = t("geometry_msgs/msg/Pose")(*self._pose(odometry, "geometry_msgs/msg/Point"))
        vector = t("geometry_msgs/msg/Vector3")
        linear = vector(*flu_to_frd(odometry.velocity_B).tolist())
        angular = vector(*flu_to_frd(odometry.rates_B).tolist())
        twist = t("geometry_msgs/msg/Twist")(linear, angular)
        message = t("nav_msgs/msg/Odometry")(
            self._header(odometry.stamp_ns, WORLD),
            f"{name}/base_link",
            t("geometry_msgs/msg/PoseWithCovariance")(pose, unknown),
            t("geometry_msgs/msg/TwistWithCovariance")(twist, unknown),
        )
        return self._encoded("odometry", message)

    def _encoded_pose(self, odometry: Odometry, name: str) -> bytes:
        t = self._type
        transform = t("geometry_msgs/msg/Transform")(
            *self._pose(odometry, "geometry_msgs/msg/Vector3")
        )
        header = self._header(odometry.stamp_ns, WORLD)
        stamped = t("geometry_msgs/msg/TransformStamped")(header, f"{name}/base_link", transform)
        return self._encoded("transforms", t("tf2_msgs/msg/TFMessage")([stamped]))

    def _encoded_cloud(self, cloud: PointCloud, vessel: int) -> bytes:
        """Give a cloud as Gazebo lays it out: one point a ray, infinite where nothing echoed."""
        name = self._world.scenario.names[vessel]
        count = len(cloud.points_S)
        points = np.zeros(count, POINT)
        points["xyz"] = cloud.points_S * np.array((1, -1, -1), np.float32)
        points["intensity"] = 0.0 if cloud.intensity is None else cloud.intensity
        points["ring"] = 0 if cloud.ring is None else cloud.ring
        rows = 1 if cloud.ring is None or not count else int(cloud.ring.max()) + 1
        field = self._type("sensor_msgs/msg/PointField")
        float32, uint16 = field.FLOAT32, field.UINT16
        fields = [field(axis, 4 * i, float32, 1) for i, axis in enumerate("xyz")]
        fields += [field("intensity", 16, float32, 1), field("ring", 20, uint16, 1)]
        width = count // rows
        message = self._type("sensor_msgs/msg/PointCloud2")(
            # Gazebo names a sensor by its whole way: model, model and link, sensor.
            self._header(cloud.stamp_ns, f"{name}/{name}/base_link/lidar_wamv_sensor"),
            rows,
            width,
            fields,
            False,
            POINT.itemsize,
            POINT.itemsize * width,
            points.view(np.uint8),
            False,
        )
        return self._encoded("points", message)

    def _encoded(self, topic: str, message: Any) -> bytes:
        return bytes(self._store.serialize_cdr(message, TOPICS[topic].ros_type))

"""Makes the golden payloads of this folder with another implementation of CDR, pycdr2 (1.0.0):
that of Eclipse Cyclone DDS for Python, as a package of its own.

    python -m venv golden
    golden/bin/pip install pycdr2==1.0.0
    golden/bin/python make_golden.py

The values are those of `tests/unit/messages/test_golden.py`. `*.be.cdr` are big endian.
"""

from dataclasses import dataclass, field
from pathlib import Path as FilePath

from pycdr2 import Endianness, IdlStruct
from pycdr2.types import (
    array,
    float32,
    float64,
    int8,
    int32,
    int64,
    sequence,
    uint8,
    uint16,
    uint32,
    uint64,
)

HERE = FilePath(__file__).parent


@dataclass
class Time(IdlStruct):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct):
    position: Vector3
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class Twist(IdlStruct):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistWithCovariance(IdlStruct):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class PoseStamped(IdlStruct):
    header: Header
    pose: Pose


@dataclass
class Path(IdlStruct):
    header: Header
    poses: sequence[PoseStamped]


@dataclass
class NavSatStatus(IdlStruct):
    status: int8
    service: uint16


@dataclass
class NavSatFix(IdlStruct):
    header: Header
    status: NavSatStatus
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


@dataclass
class Imu(IdlStruct):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class PointField(IdlStruct):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
class PointCloud2(IdlStruct):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
class Float64(IdlStruct):
    data: float64


@dataclass
class Clock(IdlStruct):
    clock: Time


@dataclass
class KeyValue(IdlStruct):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class ColorRGBA(IdlStruct):
    r: float32
    g: float32
    b: float32
    a: float32


@dataclass
class UVCoordinate(IdlStruct):
    u: float32
    v: float32


@dataclass
class CompressedImage(IdlStruct):
    header: Header
    format: str = ""
    data: sequence[uint8] = field(default_factory=list)


@dataclass
class MeshFile(IdlStruct):
    filename: str = ""
    data: sequence[uint8] = field(default_factory=list)


@dataclass
class Marker(IdlStruct):
    header: Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Time
    frame_locked: bool
    points: sequence[Vector3]
    colors: sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@dataclass
class MarkerArray(IdlStruct):
    markers: sequence[Marker]


@dataclass
class Engagement(IdlStruct):
    stamp: Time
    engaged: bool


@dataclass
class HealthEvent(IdlStruct):
    stamp: Time
    name: str
    severity: uint8
    detail: str


@dataclass
class Observation(IdlStruct):
    ego: array[float32, 7]
    objects: array[float32, 25]
    mask: array[float32, 5]


@dataclass
class Objects(IdlStruct):
    stamp: Time
    p_b: sequence[float64]
    radius: sequence[float64]
    points: sequence[int64]


@dataclass
class Tracks(IdlStruct):
    stamp: Time
    id: sequence[int64]
    p_n: sequence[float64]
    v_n: sequence[float64]
    radius: sequence[float64]
    covariance: sequence[float64]
    age_s: sequence[float64]


@dataclass
class Decision(IdlStruct):
    stamp: Time
    sequence: uint64
    acted: bool
    arrived: bool
    observed: bool
    thrust_rate: array[float64, 2]
    thrust: array[float64, 2]
    observation: Observation
    objects: Objects
    tracks: Tracks
    events: sequence[HealthEvent]


STAMP = Time(12, 345_678_901)
EMPTY = Header(Time(0, 0), "")
UP = Quaternion(0.0, 0.0, 0.0, 1.0)
NORTHEAST = Quaternion(0.0, 0.0, 0.3826834323650898, 0.9238795325112867)
"""45 degrees anticlockwise from east."""


def diagonal(a: float, b: float, c: float) -> list[float]:
    return [a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c]


def marker(
    namespace: str,
    number: int,
    kind: tuple[int, int],
    pose: Pose,
    scale: Vector3,
    color: ColorRGBA,
    frame_id: str = "base_link",
) -> Marker:
    return Marker(
        Header(STAMP, frame_id), namespace, number, *kind, pose, scale, color,
        Time(0, 500_000_000), False, [], [], "", CompressedImage(EMPTY), [], "", "", MeshFile(),
        False,
    )  # fmt: skip


def payloads() -> dict[str, IdlStruct]:
    """Give every golden message by its file's name."""
    fields = [
        PointField(name, offset, datatype, 1)
        for name, offset, datatype in (
            ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("ring", 16, 4),
        )
    ]  # fmt: skip
    data = bytes.fromhex(
        "0000803f 00000040 00004040 0000003f 0700 0000"  # 1, 2, 3; 0.5; 7
        "000080bf 0000c07f 0000807f 0000803f 1f00 0000"  # -1, NaN, infinite; 1; 31
    )
    twist = Twist(Vector3(2.0, 0.1, 0.2), Vector3(0.01, 0.02, 0.3))
    cylinder = Pose(Vector3(4.0, -1.0, 0.0), UP)
    nothing = ColorRGBA(0.0, 0.6, 0.6, 0.5)
    amber = ColorRGBA(1.0, 0.75, 0.0, 0.5)
    return {
        "odometry": Odometry(
            Header(STAMP, "world"),
            "base_link",
            PoseWithCovariance(Pose(Vector3(10.0, 20.0, 0.5), NORTHEAST), [0.0] * 36),
            TwistWithCovariance(twist, [0.0] * 36),
        ),
        "goal": PoseStamped(Header(STAMP, "world"), Pose(Vector3(30.0, 40.0, 0.0), UP)),
        "path": Path(
            Header(STAMP, "world"),
            [
                PoseStamped(Header(STAMP, "world"), Pose(Vector3(30.0, 40.0, 0.0), UP)),
                PoseStamped(Header(STAMP, "world"), Pose(Vector3(31.0, 41.5, 0.0), UP)),
            ],
        ),
        "fix": NavSatFix(
            Header(STAMP, "gps"), NavSatStatus(0, 1), -33.7221, 150.6739, 1.15,
            [0.25, 0.01, 0.0, 0.01, 0.36, 0.0, 0.0, 0.0, 1.0], 3,
        ),
        "imu": Imu(
            Header(STAMP, "imu"), NORTHEAST, diagonal(1e-4, 1e-4, 4e-4),
            Vector3(0.01, -0.02, 0.3), diagonal(8e-5, 8e-5, 8e-5),
            Vector3(0.5, -0.25, 9.81), diagonal(4e-4, 4e-4, 4e-4),
        ),
        "point_cloud": PointCloud2(
            Header(STAMP, "lidar"), 1, 2, fields, False, 20, 40, list(data), False
        ),
        "thrust": Float64(-123.456),
        "clock": Clock(STAMP),
        "engagement": Engagement(STAMP, True),
        "diagnostics": DiagnosticArray(
            Header(STAMP, ""),
            [
                DiagnosticStatus(1, "lidar_stale", "0.6 s, limit 0.4 s", "wamv1", []),
                DiagnosticStatus(0, "ready", "", "wamv1", []),
            ],
        ),
        "object_markers": MarkerArray(
            [
                marker("", 0, (0, 3), Pose(Vector3(), UP), Vector3(), nothing),
                marker("objects", 0, (3, 0), cylinder, Vector3(3.0, 3.0, 2.0), amber),
            ]
        ),
        "track_markers": MarkerArray(
            [
                marker("", 0, (0, 3), Pose(Vector3(), UP), Vector3(), nothing, "world"),
                marker("tracks", 3, (3, 0), Pose(Vector3(2.0, 1.0, 0.0), UP),
                       Vector3(3.0, 3.0, 2.0), nothing, "world"),
                marker("velocities", 3, (0, 0), Pose(Vector3(2.0, 1.0, 0.0), UP),
                       Vector3(1.5, 0.3, 0.3), nothing, "world"),
            ]
        ),
        "decision": Decision(
            STAMP, 7, True, False, True, [1000.0, -500.0], [250.0, 0.1],
            Observation([float(i) for i in range(7)], [0.5 * i for i in range(25)],
                        [1.0, 0.0, 0.0, 0.0, 0.0]),
            Objects(STAMP, [4.0, 1.0, 5.0, -2.0], [1.5, 0.75], [21, 300]),
            Tracks(STAMP, [3], [1.0, 2.0], [0.1, 0.2], [1.5], [float(i) for i in range(16)], [0.0]),
            [HealthEvent(STAMP, "policy_error", 2, "NaN ✗")],
        ),
    }  # fmt: skip


def main() -> None:
    """Write the files."""
    for name, message in payloads().items():
        (HERE / f"{name}.cdr").write_bytes(message.serialize(endianness=Endianness.Little))
        (HERE / f"{name}.be.cdr").write_bytes(message.serialize(endianness=Endianness.Big))


if __name__ == "__main__":
    main()

"""CDR of what a bridge's sensors say: NMEA sentences, radar scans; and of tracks for others.

The types are those that ROS drivers have: `nmea_msgs/Sentence`, `radar_msgs/RadarScan`, and
`vision_msgs/Detection3DArray`, which holds covariance and outline of each track. Frames are FLU and
ENU on the wire, FRD and NED here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from twinscrew.runtime.messages.navigation import (
    WORLD_FRAME,
    read_header,
    write_header,
)
from twinscrew.runtime.messages.types import Float64, Tracks
from twinscrew.runtime.messages.wire import Reader, Writer

SENTENCE_TYPE: Final = "nmea_msgs/msg/Sentence"
LONGEST_SENTENCE: Final = 200
"""[B] NMEA 0183 allows 82; some receivers put a tag block before it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sentence:
    """A sentence of NMEA 0183, as of an AIS receiver or a radar."""

    stamp_ns: int
    """[ns] When it came; 0: not known."""
    text: str
    """As "!AIVDM,...", without the end of the line."""


def encode_sentence(sentence: Sentence, *, frame_id: str = "") -> bytes:
    """Write a nmea_msgs/Sentence."""
    writer = Writer()
    write_header(writer, sentence.stamp_ns, frame_id)
    writer.string(sentence.text)
    return writer.payload()


def decode_sentence(payload: bytes | memoryview) -> Sentence:
    """Read a nmea_msgs/Sentence; a `MessageError` if it is none, or longer than any sentence."""
    reader = Reader(payload, SENTENCE_TYPE)
    stamp_ns, _ = read_header(reader)
    text = reader.string(LONGEST_SENTENCE)
    reader.end()
    return Sentence(stamp_ns=stamp_ns, text=text)


RADAR_TYPE: Final = "radar_msgs/msg/RadarScan"
MOST_RETURNS: Final = 20_000
"""[-] Of one scan; a marine radar has a few hundred above the noise."""
_RETURN_B: Final = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarScan:
    """What a radar saw in one turn."""

    stamp_ns: int
    """[ns] When."""
    range_m: Float64
    """[m] (N,) Slant range of each return."""
    bearing_rad: Float64
    """[rad] [B] (N,) Clockwise from ahead."""
    elevation_rad: Float64
    """[rad] (N,) Upwards; 0 where a radar does not measure it."""
    doppler_mps: Float64
    """[m/s] (N,) Radial velocity, away; NaN where a radar does not measure it."""
    amplitude: Float64
    """[radar's own, dB as a rule] (N,) Strength."""


def encode_radar_scan(scan: RadarScan, *, frame_id: str = "radar") -> bytes:
    """Write a radar_msgs/RadarScan: azimuths anticlockwise, as REP 103 has them."""
    writer = Writer()
    write_header(writer, scan.stamp_ns, frame_id)
    writer.values("I", 4, len(scan.range_m))
    rows = np.column_stack(
        [scan.range_m, -scan.bearing_rad, scan.elevation_rad, scan.doppler_mps, scan.amplitude]
    )
    writer.values(f"{rows.size}f", 4, *rows.astype(np.float32).ravel().tolist())
    return writer.payload()


def decode_radar_scan(payload: bytes | memoryview) -> RadarScan:
    """Read a radar_msgs/RadarScan.

    Raises
    ------
    MessageError
        Not such a message, more than `MOST_RETURNS`, or a range or azimuth that is not finite, is
        negative or beyond 1000 km.
    """
    reader = Reader(payload, RADAR_TYPE)
    stamp_ns, _ = read_header(reader)
    count = reader.count(_RETURN_B)
    if count > MOST_RETURNS:
        raise reader.fail(f"{count} returns are more than {MOST_RETURNS}")
    rows = np.array(reader.values(f"{5 * count}f", 4), np.float64).reshape(-1, 5)
    reader.end()
    if not np.isfinite(rows[:, :3]).all() or not ((rows[:, 0] >= 0) & (rows[:, 0] < 1e6)).all():
        raise reader.fail("a return's range, azimuth or elevation is no measurement")
    return RadarScan(
        stamp_ns=stamp_ns,
        range_m=rows[:, 0],
        bearing_rad=-rows[:, 1],
        elevation_rad=rows[:, 2],
        doppler_mps=rows[:, 3],
        amplitude=rows[:, 4],
    )


DETECTIONS_TYPE: Final = "vision_msgs/msg/Detection3DArray"
_UNKNOWN_VARIANCE: Final = 1e6
"""[m2], [rad2] Of what a track does not tell: height, roll, pitch."""
_HEIGHT: Final = 2.0
"""[m] How high a box is: nobody knows."""
_TURN_VARIANCE: Final = 0.01
"""[rad2] Of a heading that a vessel reports itself."""


def encode_detections(tracks: Tracks, *, frame_id: str = WORLD_FRAME) -> bytes:
    """Write tracks as a vision_msgs/Detection3DArray in the world (ENU).

    Of each track the array has the identity (`id`), what the vessel calls itself (`class_id`; else
    "vessel" or "static" by its speed), the position with its covariance, and a box: the outline
    about its centre, along its heading, or a square as wide as the circle that is known.
    """
    writer = Writer()
    write_header(writer, tracks.stamp_ns, frame_id)
    count = len(tracks.id)
    writer.values("I", 4, count)
    nothing = np.full(count, math.nan)
    half_length = nothing if tracks.half_length is None else tracks.half_length
    half_beam = nothing if tracks.half_beam is None else tracks.half_beam
    heading = nothing if tracks.heading is None else tracks.heading
    for k in range(count):
        north, east = tracks.p_N[k].tolist()
        v_north, v_east = tracks.v_N[k].tolist()
        moves = math.hypot(v_north, v_east) > 0.3
        length = 2 * float(half_length[k] if half_length[k] > 0 else tracks.radius[k])
        beam = 2 * float(half_beam[k] if half_beam[k] > 0 else tracks.radius[k])
        known = math.isfinite(heading[k])
        towards = float(heading[k]) if known else (math.atan2(v_east, v_north) if moves else 0.0)
        yaw = math.pi / 2 - towards
        pose = (east, north, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        write_header(writer, tracks.stamp_ns, frame_id)
        name = tracks.name[k] if tracks.name is not None else ""
        writer.values("I", 4, 1)
        writer.string(name or ("vessel" if moves else "static"))
        writer.values("d", 8, 1.0)
        writer.values("7d", 8, *pose)
        P = tracks.covariance[k]
        turn = _TURN_VARIANCE if known else _UNKNOWN_VARIANCE
        covariance = np.diag([0.0, 0.0, *[_UNKNOWN_VARIANCE] * 3, turn])
        covariance[:2, :2] = P[1::-1, 1::-1]  # north and east change places
        writer.values("36d", 8, *covariance.ravel().tolist())
        writer.values("7d", 8, *pose)
        writer.values("3d", 8, length, beam, _HEIGHT)
        writer.string(str(int(tracks.id[k])))
    return writer.payload()


DEFINITIONS: Final = {
    SENTENCE_TYPE: """
std_msgs/Header header
string sentence
""",
    "radar_msgs/msg/RadarReturn": """
float32 range
float32 azimuth
float32 elevation
float32 doppler_velocity
float32 amplitude
""",
    RADAR_TYPE: """
std_msgs/Header header
radar_msgs/RadarReturn[] returns
""",
    "vision_msgs/msg/ObjectHypothesis": """
string class_id
float64 score
""",
    "vision_msgs/msg/ObjectHypothesisWithPose": """
vision_msgs/ObjectHypothesis hypothesis
geometry_msgs/PoseWithCovariance pose
""",
    "vision_msgs/msg/BoundingBox3D": """
geometry_msgs/Pose center
geometry_msgs/Vector3 size
""",
    "vision_msgs/msg/Detection3D": """
std_msgs/Header header
vision_msgs/ObjectHypothesisWithPose[] results
vision_msgs/BoundingBox3D bbox
string id
""",
    DETECTIONS_TYPE: """
std_msgs/Header header
vision_msgs/Detection3D[] detections
""",
}
"""The types' fields in ROS's definition language, by name: rosbags' store does not hold them."""

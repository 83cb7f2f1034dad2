"""Does odometry move the way the boat points? Frames that are mixed up are seen nowhere else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.app.finding import Finding, fail, ok, warn
from twinscrew.runtime.errors import MessageError
from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, Odometry

Complex = NDArray[np.complex128]
Values = TypeVar("Values", Float64, Complex)

WHAT = "odometry's motion"
MOVED_M = 0.5
"""[m] A shorter way says nothing about directions."""
TURNED_RAD = np.radians(10.0)
"""[rad] Nor does a smaller turn about the sign of the yaw rate."""
ASTRAY_RAD = np.radians(20.0)
"""[rad] Position and velocity that point this far apart are in different frames."""
FACTOR = 1.5
"""[-] A way this much longer or shorter than the velocities say is in another unit."""
PUSH = "push the boat ahead, then turn it by hand, while the doctor listens"


class Motion(NamedTuple):
    """What a series of odometry says twice: by its positions, and by its velocities."""

    way_m: float
    """[m] Along the positions."""
    told_m: float
    """[m] By the velocities."""
    astray_rad: float
    """[rad] From the direction of the velocities to that of the positions, clockwise."""
    aside_rad: float
    """[rad] From where the boat points to the direction of its positions, clockwise."""
    turn_rad: float
    """[rad] By the headings, in absolute terms along the way."""
    told_turn_rad: float
    """[rad] By the yaw rates, the same, positive where they agree with the headings."""


def motion_of(series: Sequence[Odometry]) -> Motion:
    """Compare positions with velocities, and headings with yaw rates.

    Parameters
    ----------
    series
        Odometry in the order of its stamps, at least two.
    """
    time_s = 1e-9 * np.array([o.stamp_ns - series[0].stamp_ns for o in series])
    heading = np.unwrap([o.heading for o in series])
    position = _complex(np.array([o.position_N[:2] for o in series]))
    turned = [rotation_from_quaternion(o.q_NB) @ o.velocity_B for o in series]
    velocity = _complex(np.array(turned)[:, :2])
    rate = np.array([o.rates_B[2] for o in series])
    dt = np.diff(time_s)
    step, told = np.diff(position), _between(velocity) * dt
    ahead = np.exp(1j * _between(heading))
    turn, told_turn = np.diff(heading), _between(rate) * dt
    return Motion(
        way_m=float(np.abs(step).sum()),
        told_m=float(np.abs(told).sum()),
        astray_rad=float(np.angle((step * told.conj()).sum())),
        aside_rad=float(np.angle((step * ahead.conj()).sum())),
        turn_rad=float(np.abs(turn).sum()),
        told_turn_rad=float((told_turn * np.sign(turn)).sum()),
    )


def judge_motion(payloads: Sequence[bytes]) -> Finding:
    """Judge a series of encoded odometry."""
    try:
        series = [cdr.decode_odometry(payload) for payload in payloads]
    except MessageError as error:
        return fail(WHAT, str(error), "a nav_msgs/Odometry is needed")
    if len(series) < 2:
        return fail(WHAT, "no two messages to compare", "see the lines above")
    motion = motion_of(series)
    found = f"{motion.way_m:.1f} m, {np.degrees(motion.turn_rad):.0f} deg of turning"
    if motion.turn_rad > TURNED_RAD and motion.told_turn_rad < 0:
        return fail(
            WHAT, f"{found}; yaw rates of the other sign", "rates are FLU in ROS: left is positive"
        )
    if motion.way_m < MOVED_M:
        return warn(WHAT, f"{found}: too little to tell", PUSH)
    return _judge_way(motion, found)


def _judge_way(motion: Motion, found: str) -> Finding:
    astray, aside = np.degrees((motion.astray_rad, motion.aside_rad))
    if not motion.told_m * FACTOR > motion.way_m > motion.told_m / FACTOR:
        said = f"{found}, but {motion.told_m:.1f} m by the velocities"
        return fail(WHAT, said, "twist must be in m/s, in the vessel's frame, and filled in")
    if abs(motion.astray_rad) > ASTRAY_RAD:
        said = f"{found}; positions go {astray:.0f} deg clockwise of the velocities"
        return fail(WHAT, said, "the twist must be in the vessel's frame, the pose in ENU")
    if abs(motion.aside_rad) > np.pi / 4:
        said = f"{found}; it moves {aside:.0f} deg clockwise of where it points"
        return warn(WHAT, said, "if it did not drift: the heading is wrong (0 is east in ROS)")
    return ok(WHAT, f"{found}; it moves {aside:.0f} deg clockwise of where it points")


def _complex(pairs: Float64) -> Complex:
    """Give north and east as one complex number: angles then are clockwise from north."""
    north_east: Complex = pairs[:, 0] + 1j * pairs[:, 1]
    return north_east


def _between(values: Values) -> Values:
    return (values[1:] + values[:-1]) / 2

"""What was recorded of trials: motion and thrust, on one clock; and what cannot be used."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_from_quaternion
from twinscrew.runtime.link.ardupilot.thrust import (
    PaddleSettings,
    fraction_from_pwm,
    fraction_from_thrust,
)
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import Recording
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.hull_settings import paddles
from twinscrew.runtime.vessel_description import VesselDescription

Array = NDArray[np.float64]

DT_S: Final = 0.05
"""[s] Step of the model, and of what was recorded once it is resampled."""
AHEAD_S: Final = 5.0
"""[s] How far windows are predicted."""
LEAST_S: Final = 40.0
"""[s] Less than this of recorded motion is refused."""
SAME_DAY_S: Final = 3.0 * 3600.0
"""[s] Recordings nearer to each other share their wind and current."""
GAP_S: Final = 0.5
"""[s] Odometry that is missing for longer cuts a recording in two."""
SOURCES: Final = ("auto", "commanded", "measured")


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A piece of a recording without gaps, every `DT_S`; T samples."""

    name: str
    day: int
    time_s: Array
    pose: Array
    """[m, rad] [N] (T, 3) North, east, heading; the heading goes on beyond pi."""
    nu: Array
    """[m/s, rad/s] (T, 3) Surge, sway over ground in the levelled frame, yaw rate."""
    command: Array
    """[-] (T, 2) Left and right as shares of full, -1 to 1."""


def read_pieces(
    recordings: Sequence[Recording], vessel: VesselDescription, source: str = "auto"
) -> list[Piece]:
    """Read the motion and the thrust of recordings.

    Raises
    ------
    RecordingError
        Odometry or thrust are missing, or the odometry is in another frame.
    """
    pieces: list[Piece] = []
    first_s: list[float] = []
    for recording in recordings:
        time_s, pose, nu = _motion(recording)
        day = next((i for i, s in enumerate(first_s) if abs(s - time_s[0]) < SAME_DAY_S), None)
        if day is None:
            day = len(first_s)
            first_s.append(time_s[0])
        command = _command(recording, vessel, source)
        _require_frame(recording, time_s, pose, nu)
        cuts = np.flatnonzero(np.diff(time_s) > GAP_S) + 1
        for rows in np.split(np.arange(len(time_s)), cuts):
            if time_s[rows[-1]] - time_s[rows[0]] < 2.0 * AHEAD_S:
                continue
            grid = np.arange(time_s[rows[0]], time_s[rows[-1]], DT_S)
            pieces.append(
                Piece(
                    name=str(recording.path),
                    day=day,
                    time_s=grid,
                    pose=_resampled(grid, time_s[rows], pose[rows]),
                    nu=_resampled(grid, time_s[rows], nu[rows]),
                    command=_held(grid, *command),
                )
            )
    seconds = sum(len(piece.time_s) for piece in pieces) * DT_S
    if seconds < LEAST_S:
        where = ", ".join(str(recording.path) for recording in recordings)
        raise RecordingError(
            f"{where}: {seconds:.0f} s of motion without gaps, at least {LEAST_S:.0f} s are needed"
        )
    return pieces


def _motion(recording: Recording) -> tuple[Array, Array, Array]:
    if not recording.has("odometry"):
        raise RecordingError(f"{recording.path}: holds no odometry: nothing says how it moved")
    rows = []
    for message in recording.messages(("odometry",)):
        odometry = cdr.decode_odometry(message.payload)
        roll, pitch, heading = euler_from_quaternion(odometry.q_NB)
        R_NB = rotation_from_quaternion(odometry.q_NB)
        over_ground = R_NB @ odometry.velocity_B
        c, s = math.cos(heading), math.sin(heading)
        _, q, r = odometry.rates_B
        rate = (q * math.sin(roll) + r * math.cos(roll)) / max(math.cos(pitch), 0.1)
        rows.append(
            (
                odometry.stamp_ns / 1e9,
                *odometry.position_N[:2],
                heading,
                c * over_ground[0] + s * over_ground[1],
                c * over_ground[1] - s * over_ground[0],
                rate,
            )
        )
    table = np.array(rows)
    table = table[np.concatenate([[True], np.diff(table[:, 0]) > 0.0])]
    table[:, 3] = np.unwrap(table[:, 3])
    return table[:, 0], table[:, 1:4], table[:, 4:7]


def _command(recording: Recording, vessel: VesselDescription, source: str) -> tuple[Array, Array]:
    """Give when the propellers were commanded what, (K,) [s] and (K, 2) shares of full."""
    config = recording.metadata.get("config", {}).get("autopilot", {}).get("paddles")
    scale = convert(paddles(vessel) if config is None else config, PaddleSettings)
    sides: dict[str, list[tuple[float, float]]] = {}
    stamp_s, logged = None, 0.0
    for message in recording.messages(
        ("odometry", "thrust_left", "thrust_right", "pwm_left", "pwm_right")
    ):
        if message.topic == "odometry":
            # The log's clock and the stamps' may differ: what is not stamped gets the stamp of
            # the last odometry, and the log's time since.
            stamp_s = cdr.decode_odometry(message.payload).stamp_ns / 1e9
            logged = message.time_ns / 1e9
        elif stamp_s is not None:
            at_s = stamp_s + message.time_ns / 1e9 - logged
            sides.setdefault(message.topic, []).append((at_s, cdr.decode_thrust(message.payload)))
    commanded = [sides.get(f"thrust_{side}", []) for side in ("left", "right")]
    measured = [sides.get(f"pwm_{side}", []) for side in ("left", "right")]
    if not all(commanded) and not all(measured):
        raise RecordingError(
            f"{recording.path}: holds no thrust: thrust_left and thrust_right (commanded), or "
            "pwm_left and pwm_right (SERVO_OUTPUT_RAW) are needed"
        )
    if source == "measured" and not all(measured):
        raise RecordingError(f"{recording.path}: holds no pwm_left and pwm_right")
    if source == "commanded" and not all(commanded):
        raise RecordingError(f"{recording.path}: holds no thrust_left and thrust_right")
    wanted = _shares(commanded, lambda newtons: fraction_from_thrust(newtons, scale))
    got = _shares(measured, lambda us: fraction_from_pwm(us, scale))
    if source == "auto":
        source = "commanded" if wanted is not None and _obeyed(wanted, got) else "measured"
    chosen = wanted if source == "commanded" else got
    assert chosen is not None  # noqa: S101  (one of them is there)
    return chosen


def _shares(
    sides: list[list[tuple[float, float]]], share: Callable[[float], float]
) -> tuple[Array, Array] | None:
    if not all(sides):
        return None
    times, values = zip(*(np.array(side).T for side in sides), strict=True)
    at = np.unique(np.concatenate(times))
    each = [
        np.array([share(value) for value in _held(at, time, value)])
        for time, value in zip(times, values, strict=True)
    ]
    return at, np.clip(np.column_stack(each), -1.0, 1.0)


def _obeyed(wanted: tuple[Array, Array], got: tuple[Array, Array] | None) -> bool:
    """Tell whether the outputs followed the commands; without outputs nothing speaks against it."""
    if got is None:
        return True
    seen = _held(got[0] - 0.15, *wanted)
    return float(np.mean(np.abs(seen - got[1]).max(axis=1) < 0.03)) > 0.8


def _held(at: Array, time: Array, value: Array) -> Array:
    """Give the last value at or before each time; the first one before there is any."""
    rows = np.searchsorted(time, at + 1e-3, side="right") - 1  # a millisecond: stamps are rounded
    return value[np.clip(rows, 0, len(time) - 1)]


def _resampled(grid: Array, time: Array, values: Array) -> Array:
    return np.column_stack([np.interp(grid, time, column) for column in values.T])


def _require_frame(recording: Recording, time_s: Array, pose: Array, nu: Array) -> None:
    """Refuse velocities that are not the positions' change, seen from the vessel."""
    dt = np.diff(time_s)
    keep = dt < GAP_S
    if keep.sum() < 20:
        return
    moved = np.diff(pose[:, :2], axis=0)[keep] / dt[keep, None]
    heading = pose[:-1, 2][keep]
    told = nu[:-1, :2][keep]
    speed = float(np.sqrt(np.mean(moved**2) * 2.0))
    if speed < 0.1:
        return

    def off(turn: Array) -> float:
        c, s = np.cos(turn), np.sin(turn)
        seen = np.column_stack([c * told[:, 0] - s * told[:, 1], s * told[:, 0] + c * told[:, 1]])
        # Noise of the positions is large over one period: it is averaged over a second.
        width = max(1, round(1.0 / float(np.median(dt))))
        kernel = np.ones(width) / width
        error = [np.convolve(column, kernel, "valid") for column in (seen - moved).T]
        return float(np.sqrt(np.mean(np.square(error)) * 2.0)) / speed

    if off(heading) < 0.35:
        return
    others = {
        "in the world's frame (north, east), not the vessel's": np.zeros_like(heading),
        "with headings counted from east, anticlockwise (ENU)": math.pi / 2.0 - heading,
    }
    best = min(others, key=lambda words: off(others[words]))
    guess = f"; it looks as if they were given {best}" if off(others[best]) < 0.35 else ""
    raise RecordingError(
        f"{recording.path}: the odometry's velocities are not the change of its positions, seen "
        f"from the vessel (twist in child_frame_id, forward-left-up){guess}"
    )


def require_excitation(pieces: Sequence[Piece], vessel: VesselDescription) -> list[str]:
    """Refuse trials from which nothing can be learnt; say what is missing for the rest.

    Raises
    ------
    RecordingError
        The boat did not move, or its thrust never changed.
    """
    command = np.vstack([piece.command for piece in pieces])
    nu = np.vstack([piece.nu for piece in pieces])
    mean, differs = command.mean(axis=1), command[:, 0] - command[:, 1]
    top = vessel.top_speed_mps
    fast = float(np.percentile(np.abs(nu[:, 0]), 95))
    where = pieces[0].name
    if command.std(axis=0).max() < 0.02:
        raise RecordingError(
            f"{where}: the thrust hardly changes ({command.std(axis=0).max():.1%} of full): "
            "sail trials with several thrusts (twinscrew trial)"
        )
    if fast < 0.05 * top:
        raise RecordingError(
            f"{where}: the boat hardly moves ({fast:.2f} m/s at most): it is moored, or the thrust "
            "did not reach the propellers"
        )
    missing = []
    if mean.max() < 0.9:
        missing.append(f"no full thrust ahead (at most {mean.max():.0%}): the top speed is guessed")
    if mean.min() > -0.3:
        missing.append("no straight run astern: thrust astern and stopping way are guessed")
    if np.abs(differs).max() < 0.1 or np.percentile(np.abs(nu[:, 2]), 95) < 0.05 * top / (
        vessel.length_m
    ):
        missing.append("no turns: drag and inertia in yaw, and all of sway, are guessed")
    spread = np.abs(np.exp(1j * np.concatenate([p.pose[:, 2] for p in pieces])).mean())
    if spread > 0.8:
        missing.append("nearly one heading all the time: wind and current cannot be told apart")
    return missing

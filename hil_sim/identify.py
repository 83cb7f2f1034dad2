"""Identification: what a vessel's mass, drag, thrust curve and lag are, from recorded trials.

The model is the plane's part of the simulator's: Fossen's equations in surge, sway and yaw with
diagonal mass and drag (Fossen (2021), 3.3 and 6.4), propellers with a thrust curve, a dead band and a
first-order lag, and the wind and current of the day.

The fit is multiple shooting: the recording is cut into windows of a few seconds, each is predicted
from its measured beginning, and scipy's `least_squares` makes position, heading and velocities of
all windows agree with what was measured. What is known beforehand (the vessel's file, each number
with how far it may be wrong) enters as residuals, so that what the trials cannot tell stays where it
was, and is named.

Only ratios of force to mass can be seen in a motion. The mass is therefore taken as given, from a
scale; a thrust that does not fit it is reported.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from twinscrew.hil_sim.vessel.dynamics import join
from twinscrew.runtime.app.recording import Recording, find_recordings
from twinscrew.runtime.errors import NOT_THE_FORMAT, ConfigError, RecordingError
from twinscrew.runtime.geometry import euler_from_quaternion, rotation_from_quaternion
from twinscrew.runtime.link.ardupilot.thrust import (
    SPAN_US,
    STOP_US,
    PaddleSettings,
    fraction_from_thrust,
)
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.hull_settings import paddles
from twinscrew.runtime.vessel_description import (
    VesselDescription,
    VesselFile,
    VesselTable,
    describe,
    load_vessel,
)

Array = NDArray[np.float64]

DT_S: Final = 0.05
"""[s] Step of the model, and of what was recorded once it is resampled."""
AHEAD_S: Final = 5.0
"""[s] How far windows are predicted."""
STRIDE_S: Final = 1.5
"""[s] Between the beginnings of two windows."""
BLOCK_S: Final = 12.0
"""[s] Every `HOLD_OUT`-th block of this length is held out of the fit and validates it."""
HOLD_OUT: Final = 4
LEAST_S: Final = 40.0
"""[s] Less than this of recorded motion is refused."""
SAME_DAY_S: Final = 3.0 * 3600.0
"""[s] Recordings nearer to each other share their wind and current."""
GAP_S: Final = 0.5
"""[s] Odometry that is missing for longer cuts a recording in two."""
SHARES: Final = np.array([0.25, 0.5, 0.75, 1.0])
"""[-] Knots of the thrust curve between the dead band and full."""
MOST_DEAD: Final = 0.3
"""[-] A dead band is not wider than this."""
LEAST_ADDED: Final = 0.05
"""[-] Added mass in surge and sway may differ from the file's by a factor of at least this share of
the mass."""
SOURCES: Final = ("auto", "commanded", "measured")
NOT_TOLD: Final = 0.6
"""[-] A number whose standard error is more than this share of what it was before, was not told."""
TWICE: Final = math.log(1.5)
"""[-] Force by mass that differs by more from the vessel's file is a contradiction."""


class Sway(NamedTuple):
    """A parameter: how it is called, and how far it may lie from the vessel's file."""

    name: str
    sigma: float
    """[-] Of the logarithm of a factor, of a logit, or of the number itself: see `_values`."""


HULL: Final = (
    Sway("surge_added_mass", 0.8),
    Sway("sway_added_mass", 0.8),
    Sway("yaw_inertia", 0.5),
    Sway("surge_drag", 0.6),
    Sway("surge_linear_share", 1.5),
    Sway("sway_drag", 1.0),
    Sway("sway_linear_share", 1.5),
    Sway("yaw_drag", 1.0),
    Sway("yaw_linear_share", 1.5),
    Sway("thrust_ahead", 0.35),
    Sway("ahead_1", 0.6),
    Sway("ahead_2", 0.6),
    Sway("ahead_3", 0.6),
    Sway("dead_ahead", 1.5),
    Sway("thrust_astern", 0.5),
    Sway("astern_1", 0.6),
    Sway("astern_2", 0.6),
    Sway("astern_3", 0.6),
    Sway("dead_astern", 1.5),
    Sway("lag", 1.2),
    Sway("right_by_left", 0.05),
    Sway("wind_moment", 0.7),
    Sway("centre_ahead", 0.04),
)
DAY: Final = (
    Sway("wind_north", 8.0),
    Sway("wind_east", 8.0),
    Sway("current_north", 0.5),
    Sway("current_east", 0.5),
)
"""Of every day, after the hull's."""


# -- What was recorded.


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


def _command(
    recording: Recording, vessel: VesselDescription, source: str
) -> tuple[Array, Array]:
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
    got = _shares(measured, lambda us: (us - STOP_US) / SPAN_US if us > 0.0 else 0.0)
    if source == "auto":
        source = "commanded" if wanted is not None and _obeyed(wanted, got) else "measured"
    chosen = wanted if source == "commanded" else got
    assert chosen is not None  # noqa: S101  (one of them is there)
    return chosen


def _shares(sides: list[list[tuple[float, float]]], share: Any) -> tuple[Array, Array] | None:
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


# -- The model.


@dataclass(frozen=True, slots=True)
class Prior:
    """The vessel's file as the parameters' origin."""

    vessel: VesselDescription
    curve: Array
    """[-] (2, 4) Shares of full thrust at `SHARES` beyond the dead band: ahead, astern."""
    dead: Array
    """[-] (2,) Dead bands ahead and astern."""
    centre_m: float
    """[m] How far ahead of the origin the centre of gravity lies."""

    @classmethod
    def of(cls, vessel: VesselDescription) -> Prior:
        """Read a vessel's curve."""
        curve, dead = np.empty((2, 4)), np.empty(2)
        pairs = np.array(vessel.thrusters.curve or _straight(vessel))
        for row, sign in enumerate((1.0, -1.0)):
            at, force = sign * pairs[:, 0], sign * pairs[:, 1]
            order = np.argsort(at)
            at, force = at[order], np.maximum(force[order], 0.0)
            zero = at[(force <= 1e-9) & (at >= 0.0)]
            dead[row] = min(max(float(zero.max()) if len(zero) else 0.0, 0.01), MOST_DEAD - 0.01)
            full = max(float(force[-1]), 1e-9)
            knots = dead[row] + (1.0 - dead[row]) * SHARES
            curve[row] = np.maximum.accumulate(np.interp(knots, at, force) / full)
        return cls(vessel, curve, dead, float(join(vessel.parts).centre_B[0]))


def _straight(vessel: VesselDescription) -> tuple[tuple[float, float], ...]:
    thrusters = vessel.thrusters
    return (-1.0, thrusters.min_n), (0.0, 0.0), (1.0, thrusters.max_n)


class Values(NamedTuple):
    """Parameters in SI units; every one is (P, 1), of P candidates at a time."""

    mass: Array
    """(P, 3) Surge, sway [kg], yaw [kg m2], with added mass."""
    linear: Array
    """(P, 3)"""
    quadratic: Array
    """(P, 3)"""
    full: Array
    """[N] (P, 2) Of one propeller, ahead and astern, both positive."""
    curve: Array
    """[-] (P, 2, 4)"""
    dead: Array
    """[-] (P, 2)"""
    lag: Array
    """[s] (P,)"""
    right: Array
    """[-] (P,) The right propeller's thrust by the left one's."""
    windage: Array
    """(P, 3) Along, across, yaw."""
    centre_m: Array
    """[m] (P,) How far ahead of the origin the centre of gravity lies."""
    wind_N: Array
    """[m/s] (P, D, 2) Of every day."""
    current_N: Array
    """[m/s] (P, D, 2)"""


def values(theta: Array, prior: Prior) -> Values:
    """Turn parameters, (P, K), which are 0 at the vessel's file, into SI units."""
    vessel = prior.vessel
    named = {sway.name: theta[:, i] for i, sway in enumerate(HULL)}
    mass = np.empty((len(theta), 3))
    for i, name in enumerate(("surge", "sway")):
        added = vessel.added_mass[i] / vessel.mass_kg
        changed = max(added, LEAST_ADDED) * (np.exp(named[f"{name}_added_mass"]) - 1.0)
        mass[:, i] = vessel.mass_kg * (1.0 + added + changed)
    mass[:, 2] = vessel.plane_inertia[2] * np.exp(named["yaw_inertia"])
    reference = _references(vessel)
    linear, quadratic = np.empty((len(theta), 3)), np.empty((len(theta), 3))
    for i, (name, axis) in enumerate((("surge", 0), ("sway", 1), ("yaw", 5))):
        at = reference[i]
        first, second = vessel.linear_drag[axis] * at, vessel.quadratic_drag[axis] * at**2
        whole = max(first + second, 1e-9)
        share = min(max(first / whole, 0.03), 0.97)
        force = whole * np.exp(named[f"{name}_drag"])
        linear_share = _logistic(math.log(share / (1 - share)) + named[f"{name}_linear_share"])
        linear[:, i] = force * linear_share / at
        quadratic[:, i] = force * (1.0 - linear_share) / at**2
    thrusters = vessel.thrusters
    full = np.column_stack(
        [
            thrusters.max_n * np.exp(named["thrust_ahead"]),
            max(-thrusters.min_n, 1e-3) * np.exp(named["thrust_astern"]),
        ]
    )
    curve = np.empty((len(theta), 2, 4))
    dead = np.empty((len(theta), 2))
    for row, side in enumerate(("ahead", "astern")):
        steps = np.maximum(np.diff(prior.curve[row], prepend=0.0), 0.01)
        bent = np.column_stack(
            [*(np.exp(named[f"{side}_{k}"]) for k in (1, 2, 3)), np.ones(len(theta))]
        )
        curve[:, row] = np.cumsum(steps * bent, axis=1)
        curve[:, row] /= curve[:, row, -1:]
        share = prior.dead[row] / MOST_DEAD
        dead[:, row] = MOST_DEAD * _logistic(
            math.log(share / (1.0 - share)) + named[f"dead_{side}"]
        )
    days = (theta.shape[1] - len(HULL)) // len(DAY)
    day = theta[:, len(HULL) :].reshape(len(theta), days, len(DAY))
    windage = np.tile(
        [vessel.windage.along, vessel.windage.across, vessel.windage.yaw], (len(theta), 1)
    )
    windage[:, 2] *= np.exp(named["wind_moment"])
    return Values(
        mass=mass,
        linear=linear,
        quadratic=quadratic,
        full=full,
        curve=curve,
        dead=dead,
        lag=_lag(thrusters.time_constant_s, named["lag"]),
        right=np.exp(named["right_by_left"]),
        windage=windage,
        centre_m=prior.centre_m + vessel.length_m * named["centre_ahead"],
        wind_N=day[:, :, :2],
        current_N=day[:, :, 2:],
    )


def _references(vessel: VesselDescription) -> tuple[float, float, float]:
    """[m/s, m/s, rad/s] Where linear and quadratic drag are compared."""
    top = vessel.top_speed_mps
    return 0.7 * top, 0.3 * top, 0.7 * top / vessel.length_m


def _lag(known_s: float, x: Array) -> Array:
    """[s] A file may say that there is none, so that no factor leads to another lag."""
    return np.maximum(known_s + max(known_s, 0.05) * (np.exp(x) - 1.0), 1e-3)


def _logistic(x: Array) -> Array:
    return 1.0 / (1.0 + np.exp(-x))


def thrust(found: Values, row: int, command: Array) -> Array:
    """Give the thrust, (T, 2) [N], after curve and lag, of the candidate `row`: each step's mean."""
    knots = np.concatenate([[0.0], SHARES])
    forces = np.empty_like(command)
    for sign, side in ((1.0, 0), (-1.0, 1)):
        dead = found.dead[row, side]
        beyond = np.clip((sign * command - dead) / (1.0 - dead), 0.0, 1.0)
        shape = np.concatenate([[0.0], found.curve[row, side]])
        part = found.full[row, side] * np.interp(beyond, knots, shape)
        forces = part if side == 0 else np.where(command < 0.0, -part, forces)
    forces = forces * np.array([1.0, found.right[row]])
    lag = float(found.lag[row])
    keep = math.exp(-DT_S / lag)
    # The thrust at each step's end, from the command that was held during the step.
    ends = lfilter([1.0 - keep], [1.0, -keep], forces, axis=0, zi=keep * forces[:1])[0]
    begins = np.vstack([forces[:1], ends[:-1]])
    return np.asarray(forces + (begins - forces) * (lag / DT_S) * (1.0 - keep))


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of all pieces: W of them, each of H steps."""

    start: Array
    """(W, 6) Measured beginnings: pose, velocities."""
    measured: Array
    """(W, H, 6) What came after."""
    at: NDArray[np.int64]
    """(W,) Row of each beginning in all pieces laid end to end."""
    day: NDArray[np.int64]
    """(W,)"""
    block: NDArray[np.int64]
    """(W,) Number of its stretch of `BLOCK_S`."""
    held_out: NDArray[np.bool_]
    """(W,)"""

    def __getitem__(self, rows: NDArray[Any]) -> Windows:
        return Windows(
            self.start[rows],
            self.measured[rows],
            self.at[rows],
            self.day[rows],
            self.block[rows],
            self.held_out[rows],
        )


def cut(pieces: Sequence[Piece]) -> Windows:
    """Cut pieces into windows; every `HOLD_OUT`-th block is held out, and what reaches into one."""
    steps, stride = round(AHEAD_S / DT_S), round(STRIDE_S / DT_S)
    block = round(BLOCK_S / DT_S)
    rows: list[tuple[Array, Array, int, int, int, int]] = []
    before = blocks = 0
    for piece in pieces:
        state = np.hstack([piece.pose, piece.nu])
        smooth = _smoothed(state)
        for first in range(0, len(state) - steps - 1, stride):
            begin, end = first // block, (first + steps) // block
            kind = {(number + blocks) % HOLD_OUT == HOLD_OUT - 1 for number in (begin, end)}
            if len(kind) > 1:
                continue  # partly held out: neither
            window = state[first + 1 : first + 1 + steps]
            rows.append(
                (smooth[first], window, before + first, piece.day, blocks + begin, kind.pop())
            )
        before += len(state)
        blocks += len(state) // block + 1
    start, measured, at, day, number, held = zip(*rows, strict=True)
    return Windows(
        np.array(start),
        np.array(measured),
        np.array(at),
        np.array(day),
        np.array(number),
        np.array(held, dtype=np.bool_),
    )


def _smoothed(state: Array) -> Array:
    """Take noise off the beginnings: a quadratic through 0.4 s around (Savitzky and Golay)."""
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(state, 9, 2, axis=0), dtype=np.float64)


def predict(
    found: Values, prior: Prior, windows: Windows, command: Array, every: int = 1
) -> Array:
    """Predict windows with each of P candidates.

    Parameters
    ----------
    command : (T, 2) float64
        All pieces' commands, end to end.

    Returns
    -------
    states : (P, W, H / every, 6) float64
        Pose and velocities over ground, after every so many steps.
    """
    count, steps = len(found.lag), windows.measured.shape[1]
    lever = prior.vessel.lever_m
    rows = windows.at[:, None] + np.arange(steps)
    pushes = np.stack([thrust(found, p, command)[rows] for p in range(count)])
    surge_n = pushes.sum(axis=-1)
    yaw_nm = lever * (pushes[..., 0] - pushes[..., 1])
    current = found.current_N[:, windows.day]
    wind = found.wind_N[:, windows.day]
    n, e, psi, u, v, r = (
        np.tile(column, (count, 1)) for column in windows.start.T
    )
    c, s = np.cos(psi), np.sin(psi)
    u = u - c * current[..., 0] - s * current[..., 1]
    v = v - c * current[..., 1] + s * current[..., 0]
    m11, m22, m33 = (found.mass[:, i, None] for i in range(3))
    l1, l2, l3 = (found.linear[:, i, None] for i in range(3))
    q1, q2, q3 = (found.quadratic[:, i, None] for i in range(3))
    offset = prior.vessel.mass_kg * found.centre_m[:, None]
    det = m22 * m33 - offset**2
    along, across, about = (found.windage[:, i, None] for i in range(3))

    def slope(psi: Array, u: Array, v: Array, r: Array, k: int) -> tuple[Array, ...]:
        c, s = np.cos(psi), np.sin(psi)
        north = c * u - s * v + current[..., 0]
        east = s * u + c * v + current[..., 1]
        blows = wind[..., 0] - north, wind[..., 1] - east
        wx, wy = c * blows[0] + s * blows[1], c * blows[1] - s * blows[0]
        px, py = m11 * u, m22 * v + offset * r  # momentum: Kirchhoff's equations
        du = r * py - (l1 + q1 * np.abs(u)) * u + surge_n[..., k] + along * wx * np.abs(wx)
        dv = -r * px - (l2 + q2 * np.abs(v)) * v + across * wy * np.abs(wy)
        dr = v * px - u * py - (l3 + q3 * np.abs(r)) * r + yaw_nm[..., k]
        dr = dr - 2.0 * about * wx * wy
        return north, east, r, du / m11, (m33 * dv - offset * dr) / det, (m22 * dr - offset * dv) / det

    out = np.empty((count, len(windows.at), steps // every, 6))
    for k in range(steps):  # Heun's method
        first = slope(psi, u, v, r, k)
        middle = (psi + DT_S * first[2], u + DT_S * first[3], v + DT_S * first[4])
        second = slope(*middle, r + DT_S * first[5], k)
        half = 0.5 * DT_S
        n, e = n + half * (first[0] + second[0]), e + half * (first[1] + second[1])
        psi = psi + half * (first[2] + second[2])
        u, v = u + half * (first[3] + second[3]), v + half * (first[4] + second[4])
        r = r + half * (first[5] + second[5])
        if (k + 1) % every:
            continue
        c, s = np.cos(psi), np.sin(psi)
        over_u = u + c * current[..., 0] + s * current[..., 1]
        over_v = v + c * current[..., 1] - s * current[..., 0]
        for i, value in enumerate((n, e, psi, over_u, over_v, r)):
            out[:, :, k // every, i] = value
    return out


# -- The fit.


class Problem:
    """Windows, commands and the vessel's file: what is to agree."""

    EVERY: Final = 10
    """[-] Every so many steps of a window count."""

    def __init__(self, pieces: Sequence[Piece], vessel: VesselDescription) -> None:
        self.prior = Prior.of(vessel)
        self.windows = cut(pieces)
        self.command = np.vstack([piece.command for piece in pieces])
        self.days = 1 + max(piece.day for piece in pieces)
        sways = (*HULL, *(DAY * self.days))
        self.sigma = np.array([sway.sigma for sway in sways])
        self.names = [sway.name for sway in sways]
        speed, length = vessel.top_speed_mps, vessel.length_m
        slow = 0.05 * speed
        self.scale = np.array([0.1 * length, 0.1 * length, 0.05, slow, slow, slow / length])

    def errors(self, theta: Array, windows: Windows) -> Array:
        """Give predicted less measured, (P, W, H', 6); positions along and across the beginning."""
        found = values(theta, self.prior)
        states = predict(found, self.prior, windows, self.command, self.EVERY)
        off = states - windows.measured[:, self.EVERY - 1 :: self.EVERY]
        c, s = np.cos(windows.start[:, 2]), np.sin(windows.start[:, 2])
        c, s = c[:, None], s[:, None]
        north, east = off[..., 0].copy(), off[..., 1].copy()
        off[..., 0], off[..., 1] = c * north + s * east, c * east - s * north
        return off

    def fit(self, windows: Windows, free: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """Fit, and give parameters (K,) and their covariance (K, K)."""
        use = np.ones(len(self.sigma), dtype=np.bool_) if free is None else free
        theta = np.zeros(len(self.sigma))
        scale = np.tile(self.scale, (windows.measured.shape[1] // self.EVERY, 1))
        solution = None
        for _ in range(3):  # weights follow from what was left over, sample by sample
            theta, solution = self._solve(theta, windows, use, scale)
            left = self.errors(theta[None], windows)[0]
            scale = np.maximum(1.4826 * np.median(np.abs(left), axis=0), 0.02 * self.scale)
        assert solution is not None  # noqa: S101  (the loop ran)
        return theta, self._covariance(theta, windows, use, scale)

    def _residuals(self, theta: Array, windows: Windows, scale: Array) -> Array:
        """(P, R) Of the windows alone, whitened by channel; samples of a window count as one."""
        off = self.errors(theta, windows) / scale
        return off.reshape(len(theta), -1) / math.sqrt(off.shape[2])

    def _solve(
        self, theta: Array, windows: Windows, use: NDArray[np.bool_], scale: Array
    ) -> tuple[Array, Any]:
        sigma = self.sigma[use]

        def whole(x: Array) -> Array:
            full = np.tile(theta, (len(x), 1))
            full[:, use] = x
            return np.hstack([self._residuals(full, windows, scale), x / sigma])

        def residuals(x: Array) -> Array:
            return np.clip(whole(x[None])[0], -1e6, 1e6)

        def jacobian(x: Array) -> Array:
            step = 1e-4 * sigma
            nudged = np.vstack([x, x + np.diag(step)])
            found = np.clip(whole(nudged), -1e6, 1e6)
            return np.asarray((found[1:] - found[0]).T / step)

        bound = 4.0 * sigma
        solution = least_squares(
            residuals,
            np.clip(theta[use], -0.99 * bound, 0.99 * bound),
            jac=jacobian,
            bounds=(-bound, bound),
            x_scale=sigma,
            loss="soft_l1",
            ftol=1e-5,
            xtol=1e-4,
            max_nfev=15,
        )
        fitted = theta.copy()
        fitted[use] = solution.x
        return fitted, solution

    def _covariance(
        self, theta: Array, windows: Windows, use: NDArray[np.bool_], scale: Array
    ) -> Array:
        """Sandwich of the Gauss-Newton matrix and of the blocks' gradients: errors within a block
        of time are one error (waves, gusts), not hundreds."""
        sigma = self.sigma
        step = 1e-4 * sigma
        nudged = np.vstack([theta, theta + np.diag(step)])
        found = self._residuals(nudged, windows, scale)
        jacobian = ((found[1:] - found[0]).T / step)[:, use]
        residual = found[0]
        weight = 1.0 / np.sqrt(1.0 + residual**2)
        bread = jacobian.T @ (weight[:, None] * jacobian) + np.diag(sigma[use] ** -2.0)
        each = len(residual) // len(windows.at)
        per_window = (jacobian * (weight * residual)[:, None]).reshape(-1, each, use.sum()).sum(1)
        blocks = np.unique(windows.block, return_inverse=True)[1]
        gradients = np.zeros((blocks.max() + 1, use.sum()))
        np.add.at(gradients, blocks, per_window)
        count = len(gradients)
        meat = gradients.T @ gradients * count / max(count - 1, 1) + np.diag(sigma[use] ** -2.0)
        inverse = np.linalg.inv(bread)
        covariance = np.zeros((len(sigma), len(sigma)))
        covariance[np.ix_(use, use)] = inverse @ meat @ inverse
        return covariance


# -- What came of it.


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """How far predictions of windows that were held out are off."""

    position_rmse_5s_m: float
    """[m] After 5 s."""
    speed_rmse_mps: float
    """[m/s] Surge, over all 5 s."""
    yaw_rate_rmse_rad_s: float
    """[rad/s] Over all 5 s."""

    def as_dict(self) -> dict[str, float]:
        """Give the three numbers, to four digits."""
        return {name: float(f"{getattr(self, name):.4g}") for name in self.__slots__}


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number with its interval."""

    value: float
    low: float
    high: float
    """Of the interval that holds it with 95 %, if the model is right."""
    unit: str
    told: bool
    """Whether the trials told it; else it is still what the vessel's file, or its estimate, says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """What was found, and how good it is."""

    table: dict[str, Any]
    """The table `[vessel]` of the vessel as identified."""
    vessel: VesselDescription
    validation: Validation
    """Of the identified vessel: windows that no fit has seen, predicted for 5 s."""
    given: Validation
    """The same of the vessel's file as it was, with the best wind and current for it."""
    estimates: dict[str, Estimate]
    weather: tuple[dict[str, float], ...]
    """Wind and current of every day: north, east [m/s]."""
    warnings: tuple[str, ...]
    """What does not fit, and what the trials cannot tell."""
    contradiction: str
    """How the vessel's file contradicts the trials; empty if it does not."""
    seconds: float
    """[s] Of motion that was used."""
    held_out_s: float
    """[s] Of it held out for the validation."""
    shown: Shown
    """What the figure draws."""

    def as_dict(self) -> dict[str, Any]:
        """Give the object that `identify --json` prints."""
        return {
            "vessel": self.table,
            "validation": self.validation.as_dict(),
            "given": self.given.as_dict(),
            "estimates": {
                name: {
                    "value": _digits(e.value),
                    "low": _digits(e.low),
                    "high": _digits(e.high),
                    "unit": e.unit,
                    "told": e.told,
                }
                for name, e in self.estimates.items()
            },
            "weather": list(self.weather),
            "contradiction": self.contradiction,
            "warnings": list(self.warnings),
            "seconds": round(self.seconds, 1),
            "held_out_s": round(self.held_out_s, 1),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """Held-out windows, measured and predicted; and the thrust curve with its band."""

    time_s: Array
    """(W,) Beginnings."""
    measured: Array
    """(W, H, 6)"""
    identified: Array
    given: Array
    """(W, H, 6)"""
    error_m: Array
    """(2, H) RMS position error over the horizon: identified, given."""
    command: Array
    """(C,)"""
    curves: Array
    """[N] (4, C) Given, identified, 2.5 % and 97.5 % of it."""


def identify(
    recordings: Sequence[Path], vessel: str | VesselDescription, *, source: str = "auto"
) -> Identification:
    """Identify a vessel from recorded trials.

    Parameters
    ----------
    recordings
        Folders or files of one vessel's recordings.
    vessel
        What is known of it: a name in config/vessels, a file or a description. The eight least
        keys are enough; mass and spacing are taken as measured.
    source
        Where the thrust comes from: "commanded" (thrust_left, thrust_right), "measured" (pwm_left,
        pwm_right) or "auto": commanded if the outputs followed.

    Raises
    ------
    RecordingError
        A recording cannot be used: it says what is missing.
    ConfigError
        The vessel's file cannot be used, or what was identified cannot be a vessel.
    """
    known = load_vessel(vessel) if isinstance(vessel, str) else vessel
    found = [one for path in recordings for one in find_recordings(path)]
    pieces = read_pieces(found, known, source)
    warnings = require_excitation(pieces, known)
    problem = Problem(pieces, known)
    windows = problem.windows
    train, test = windows[~windows.held_out], windows[windows.held_out]
    if len(test.at) < 3 or len(train.at) < 10:
        raise RecordingError(
            f"{found[0].path}: only {len(windows.at)} windows of {AHEAD_S:g} s: sail longer trials"
        )
    weather = np.array([name in {sway.name for sway in DAY} for name in problem.names])
    given, _ = problem.fit(train, weather)
    theta, _ = problem.fit(train)
    validation, before = (_validation(problem, x, test) for x in (theta, given))
    final, covariance = problem.fit(windows)
    draws = np.random.default_rng(0).multivariate_normal(final, covariance, size=400)
    draws = np.clip(draws, -4.0 * problem.sigma, 4.0 * problem.sigma)
    told = np.sqrt(np.diag(covariance)) < NOT_TOLD * problem.sigma
    estimates = _estimates(problem, final, draws, told)
    table = _table(problem, final)
    try:
        described = describe(table_of(table), key=known.key)
    except ConfigError as error:
        raise ConfigError(f"what was identified is no vessel: {error}") from error
    contradiction = _contradiction(problem, final, draws, validation, before)
    warnings += _not_told(problem, told)
    if validation.position_rmse_5s_m > 0.2 * known.length_m:
        warnings.append(
            f"the fit itself is {validation.position_rmse_5s_m / known.length_m:.2f} lengths off "
            "after 5 s: something acts on the boat that the model does not know"
        )
    per_day = final[len(HULL) :].reshape(problem.days, len(DAY))
    return Identification(
        table=table,
        vessel=described,
        validation=validation,
        given=before,
        estimates=estimates,
        weather=tuple(
            {sway.name: _digits(float(x)) for sway, x in zip(DAY, day, strict=True)}
            for day in per_day
        ),
        warnings=tuple(warnings),
        contradiction=contradiction,
        seconds=sum(len(piece.time_s) for piece in pieces) * DT_S,
        held_out_s=len(np.unique(test.block)) * BLOCK_S,
        shown=_shown(problem, pieces, test, theta, given, final, draws),
    )


def table_of(table: dict[str, Any]) -> VesselTable:
    """Read a table `[vessel]`."""
    return convert({"vessel": table}, VesselFile).vessel


def check(recordings: Sequence[Path], vessel: str | VesselDescription) -> tuple[bool, str]:
    """Tell whether a vessel's file predicts its recordings as well as a fit explains them."""
    found = identify(recordings, vessel)
    length = found.vessel.length_m
    words = (
        f"predicts 5 s to {found.given.position_rmse_5s_m:.2f} m, a fit to "
        f"{found.validation.position_rmse_5s_m:.2f} m (length {length:g} m)"
    )
    if not found.contradiction:
        return True, words
    return False, f"{words}; {found.contradiction}"


def _validation(problem: Problem, theta: Array, windows: Windows) -> Validation:
    off = problem.errors(theta[None], windows)[0]
    return Validation(
        position_rmse_5s_m=float(np.sqrt((off[:, -1, :2] ** 2).sum(axis=1).mean())),
        speed_rmse_mps=float(np.sqrt((off[..., 3] ** 2).mean())),
        yaw_rate_rmse_rad_s=float(np.sqrt((off[..., 5] ** 2).mean())),
    )


def _top_speed(found: Values) -> Array:
    """[m/s] (P,) In calm water, both full ahead."""
    linear, quadratic = found.linear[:, 0], found.quadratic[:, 0]
    whole = found.full[:, 0] * (1.0 + found.right)
    root = np.sqrt(linear**2 + 4.0 * quadratic * whole)
    return np.asarray(2.0 * whole / (linear + root))


_UNITS: Final = {
    "surge_mass_kg": "kg",
    "sway_mass_kg": "kg",
    "yaw_inertia_kgm2": "kg m2",
    "surge_drag_at_top_n": "N",
    "sway_drag_n": "N",
    "yaw_drag_nm": "N m",
    "thrust_max_n": "N",
    "thrust_min_n": "N",
    "dead_band_ahead": "-",
    "dead_band_astern": "-",
    "lag_s": "s",
    "right_by_left": "-",
    "top_speed_mps": "m/s",
}


def _quantities(problem: Problem, theta: Array) -> dict[str, Array]:
    """Give what is reported, (P,) each, of parameters (P, K)."""
    found = values(theta, problem.prior)
    at = np.array(_references(problem.prior.vessel))
    drag = found.linear * at + found.quadratic * at**2
    top = _top_speed(found)
    side = (1.0 + found.right) / 2.0
    return {
        "surge_mass_kg": found.mass[:, 0],
        "sway_mass_kg": found.mass[:, 1],
        "yaw_inertia_kgm2": found.mass[:, 2],
        "surge_drag_at_top_n": found.linear[:, 0] * top + found.quadratic[:, 0] * top**2,
        "sway_drag_n": drag[:, 1],
        "yaw_drag_nm": drag[:, 2],
        "thrust_max_n": found.full[:, 0] * side,
        "thrust_min_n": -found.full[:, 1] * side,
        "dead_band_ahead": found.dead[:, 0],
        "dead_band_astern": found.dead[:, 1],
        "lag_s": found.lag,
        "right_by_left": found.right,
        "top_speed_mps": top,
    }


_TELLS: Final = {
    "surge_mass_kg": "surge_added_mass",
    "sway_mass_kg": "sway_added_mass",
    "yaw_inertia_kgm2": "yaw_inertia",
    "surge_drag_at_top_n": "surge_drag",
    "sway_drag_n": "sway_drag",
    "yaw_drag_nm": "yaw_drag",
    "thrust_max_n": "thrust_ahead",
    "thrust_min_n": "thrust_astern",
    "dead_band_ahead": "dead_ahead",
    "dead_band_astern": "dead_astern",
    "lag_s": "lag",
    "right_by_left": "right_by_left",
    "top_speed_mps": "surge_drag",
}
"""Which parameter has to be told for a number to be told."""


def _estimates(
    problem: Problem, theta: Array, draws: Array, told: NDArray[np.bool_]
) -> dict[str, Estimate]:
    best, spread = _quantities(problem, theta[None]), _quantities(problem, draws)
    return {
        name: Estimate(
            value=float(best[name][0]),
            low=float(np.percentile(spread[name], 2.5)),
            high=float(np.percentile(spread[name], 97.5)),
            unit=unit,
            told=bool(told[problem.names.index(_TELLS[name])]),
        )
        for name, unit in _UNITS.items()
    }


def _not_told(problem: Problem, told: NDArray[np.bool_]) -> list[str]:
    words = {
        "surge_added_mass": "added mass in surge",
        "sway_added_mass": "added mass in sway",
        "yaw_inertia": "inertia in yaw",
        "sway_drag": "drag in sway",
        "yaw_drag": "drag in yaw",
        "thrust_astern": "thrust astern",
        "dead_ahead": "the dead band ahead",
        "dead_astern": "the dead band astern",
        "lag": "the propellers' lag",
    }
    missing = [
        text for name, text in words.items() if not told[problem.names.index(name)]
    ]
    fixed = "mass and thrust are told only by their ratio: the mass is the file's"
    return [fixed, *([f"the trials do not tell {', '.join(missing)}"] if missing else [])]


def _contradiction(
    problem: Problem, theta: Array, draws: Array, fitted: Validation, given: Validation
) -> str:
    """Say how the file contradicts the trials: by force per mass, or by its predictions."""
    vessel = problem.prior.vessel
    ratios = [
        values(x, problem.prior).full[:, 0] / values(x, problem.prior).mass[:, 0]
        for x in (theta[None], draws)
    ]
    known = vessel.thrusters.max_n / vessel.plane_inertia[0]
    share = float(ratios[0][0] / known)
    low, high = (float(np.percentile(ratios[1], q) / known) for q in (2.5, 97.5))
    worse = given.position_rmse_5s_m > 1.5 * fitted.position_rmse_5s_m
    matters = given.position_rmse_5s_m > 0.1 * vessel.length_m
    if abs(math.log(share)) > TWICE and not low <= 1.0 <= high:
        return (
            f"full thrust accelerates the boat {share:.2f} times ({low:.2f} to {high:.2f}) as much "
            f"as the file's mass_kg = {vessel.mass_kg:g} and thrust_max_n = "
            f"{vessel.thrusters.max_n:g} say: if the thrust is right, the mass is "
            f"{vessel.mass_kg / share:.3g} kg; if the mass is right, the thrust is "
            f"{vessel.thrusters.max_n * share:.3g} N"
        )
    if worse and matters:
        ratio = given.position_rmse_5s_m / max(fitted.position_rmse_5s_m, 1e-9)
        return (
            f"the file's vessel predicts 5 s {ratio:.1f} times as badly as one that fits "
            f"({given.position_rmse_5s_m:.2f} m, {fitted.position_rmse_5s_m:.2f} m)"
        )
    return ""


def _table(problem: Problem, theta: Array) -> dict[str, Any]:
    """Give the table `[vessel]`: what the file said, with what was identified over it."""
    vessel = problem.prior.vessel
    found = values(theta[None], problem.prior)
    mass, linear, quadratic = found.mass[0], found.linear[0], found.quadratic[0]
    # Only ratios are told. Where the trials ask for less than the mass itself, all is scaled.
    scale = max(1.0, vessel.mass_kg / mass[0])
    mass, linear, quadratic = scale * mass, scale * linear, scale * quadratic
    side = scale * float(1.0 + found.right[0]) / 2.0
    ahead, astern = side * found.full[0]
    body = join(vessel.parts)
    centre = [round(float(x), 4) for x in (found.centre_m[0], *body.centre_B[1:])]
    yaw_own = min(float(body.inertia_B[2, 2]), 0.8 * (mass[2] - vessel.mass_kg * centre[0] ** 2))
    table = _as_written(vessel)
    table.update(
        name=f"{vessel.name}, identified",
        thrust_max_n=_digits(ahead),
        thrust_min_n=_digits(-astern),
        top_speed_mps=_digits(float(_top_speed(found)[0])),
        inertia={
            "roll_kgm2": _digits(float(body.inertia_B[0, 0])),
            "pitch_kgm2": _digits(float(body.inertia_B[1, 1])),
            "yaw_kgm2": _digits(yaw_own),
            "centre_m": centre,
        },
    )
    table.pop("parts", None)
    table.pop("plane_model", None)
    offset = vessel.mass_kg * centre[0] ** 2
    named = {"surge": 0, "sway": 1, "yaw": 5}
    for key, both, of in (
        ("added_mass", np.array([*(mass[:2] - vessel.mass_kg), mass[2] - yaw_own - offset]),
         vessel.added_mass),
        ("linear_drag", linear, vessel.linear_drag),
        ("quadratic_drag", quadratic, vessel.quadratic_drag),
    ):
        six = dict(zip(("surge", "sway", "heave", "roll", "pitch", "yaw"), of, strict=True))
        for (name, _), value in zip(named.items(), both, strict=True):
            six[name] = max(float(value), 0.0)
        table[key] = {name: _digits(value) for name, value in six.items()}
    thrusters = dict(table.get("thrusters", {}))
    thrusters["curve"] = _curve(found, float(table["thrust_max_n"]), -float(table["thrust_min_n"]))
    thrusters["time_constant_s"] = round(float(found.lag[0]), 3)
    table["thrusters"] = thrusters
    table["windage"] = {
        "along": _digits(scale * vessel.windage.along),
        "across": _digits(scale * vessel.windage.across),
        "yaw": _digits(scale * float(found.windage[0, 2])),
    }
    return table


def _as_written(vessel: VesselDescription) -> dict[str, Any]:
    """Give what the vessel's file says, or the description's numbers where there is no file."""
    from twinscrew.runtime.settings import load, shipped

    try:
        table = load(shipped("vessels", vessel.key), VesselFile).vessel
    except (ConfigError, *NOT_THE_FORMAT):
        return {
            "name": vessel.name,
            "length_m": vessel.length_m,
            "beam_m": vessel.beam_m,
            "mass_kg": vessel.mass_kg,
            "thruster_spacing_m": vessel.thruster_spacing_m,
        }
    return _said(msgspec.to_builtins(table))


def _said(table: dict[str, Any]) -> dict[str, Any]:
    """Leave out what is not said: TOML has no word for nothing."""
    inner = {key: _said(value) if isinstance(value, dict) else value for key, value in table.items()}
    return {key: value for key, value in inner.items() if value not in (None, {}, [], ())}


def _curve(found: Values, ahead: float, astern: float) -> list[list[float]]:
    """Give the thrust curve as a vessel's file has it: pairs of command and newtons."""
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    for sign, side, full in ((1.0, 0, ahead), (-1.0, 1, astern)):
        dead = round(float(found.dead[0, side]), 4)
        shape = found.curve[0, side]
        if dead >= 0.005:
            points.append((sign * dead, 0.0))
        else:
            dead = 0.0
        for at, share in zip(SHARES, shape, strict=True):
            command = round(dead + (1.0 - dead) * float(at), 4)
            points.append((sign * command, sign * full * float(share)))
    points.sort()
    curve = [[command, _digits(newtons)] for command, newtons in points]
    curve[0] = [-1.0, -astern]
    curve[-1] = [1.0, ahead]
    return curve


def _digits(value: float) -> float:
    return float(f"{value:.5g}")


def _shown(
    problem: Problem,
    pieces: Sequence[Piece],
    test: Windows,
    theta: Array,
    given: Array,
    final: Array,
    draws: Array,
) -> Shown:
    times = np.concatenate([piece.time_s for piece in pieces])
    both = predict(
        values(np.vstack([theta, given]), problem.prior), problem.prior, test, problem.command
    )
    off = both[..., :2] - test.measured[None, ..., :2]
    command = np.linspace(-1.0, 1.0, 81)
    every = values(np.vstack([final, draws[:200]]), problem.prior)
    curves = np.array([_force(every, row, command) for row in range(201)])
    known = np.array(problem.prior.vessel.thrusters.curve or _straight(problem.prior.vessel))
    band = np.percentile(curves[1:], (2.5, 97.5), axis=0)
    return Shown(
        time_s=times[test.at] - times[0],
        measured=test.measured,
        identified=both[0],
        given=both[1],
        error_m=np.sqrt((off**2).sum(axis=-1).mean(axis=1)),
        command=command,
        curves=np.vstack([np.interp(command, *known.T), curves[0], band]),
    )


def _force(found: Values, row: int, command: Array) -> Array:
    """Give the steady thrust [N] of the left propeller at commands, (C,)."""
    total = np.zeros_like(command)
    for sign, side in ((1.0, 0), (-1.0, 1)):
        dead = found.dead[row, side]
        beyond = np.clip((sign * command - dead) / (1.0 - dead), 0.0, 1.0)
        shape = np.concatenate([[0.0], found.curve[row, side]])
        total += sign * found.full[row, side] * np.interp(beyond, [0.0, *SHARES], shape)
    return total


def draw(found: Identification, path: Path) -> None:
    """Draw measured against predicted as a PNG file, and an SVG file beside it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = found.shown
    figure = Figure(figsize=(11.0, 7.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    steps = np.arange(1, shown.measured.shape[1] + 1) * DT_S
    colours = {"measured": "0.2", "identified": "C0", "given": "C1"}
    for axis, column, unit in ((axes[0, 0], 3, "surge [m/s]"), (axes[0, 1], 5, "yaw rate [rad/s]")):
        for name, colour in colours.items():
            rows = getattr(shown, name)[::3, :, column]
            for i, row in enumerate(rows):
                time = shown.time_s[::3][i] + steps
                axis.plot(time, row, color=colour, linewidth=1.2, label=name if i == 0 else None)
        axis.set(xlabel="time [s]", ylabel=unit, title="held out: measured, and predicted for 5 s")
        axis.legend(frameon=False)
    axis = axes[1, 0]
    for row, name in zip(shown.error_m, ("identified", "given"), strict=True):
        axis.plot(steps, row, color=colours[name], label=name)
    axis.axhline(0.1 * found.vessel.length_m, color="0.6", linestyle=":", label="0.1 length")
    axis.set(xlabel="predicted for [s]", ylabel="RMS position error [m]", title="held out")
    axis.legend(frameon=False)
    axis = axes[1, 1]
    axis.fill_between(shown.command, shown.curves[2], shown.curves[3], color="C0", alpha=0.25)
    axis.plot(shown.command, shown.curves[1], color="C0", label="identified, 95 %")
    axis.plot(shown.command, shown.curves[0], color="C1", label="given")
    axis.set(xlabel="command [share of full]", ylabel="thrust of one [N]", title="thrust curve")
    axis.legend(frameon=False)
    for axis in axes.flat:
        axis.grid(color="0.92")
        axis.set_axisbelow(True)
    for suffix in (".png", ".svg"):
        figure.savefig(path.with_suffix(suffix))

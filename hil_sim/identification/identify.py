"""Identification: what a vessel's mass, drag, thrust curve and lag are, from recorded trials.

The model is the plane's part of the simulator's: Fossen's equations in surge, sway and yaw with
diagonal drag (Fossen (2021), 3.3 and 6.4), propellers with a thrust curve, a dead band and a
first-order lag, and the wind and current of the day.

The fit is multiple shooting: the recording is cut into windows of 5 s, each is predicted from its
measured beginning, and scipy's `least_squares` makes position, heading and velocities of all
windows agree with what was measured. What is known beforehand (the vessel's file, each number with
how far it may be wrong) enters as residuals, so that what the trials cannot tell stays where it
was, and is named.

Only ratios of force to mass can be seen in a motion. The mass is therefore taken as given, from a
scale; a thrust that does not fit it is reported.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim.identification.fit import BLOCK_S, Problem
from twinscrew.hil_sim.identification.model import (
    DAY,
    GRID,
    HULL,
    STEPS,
    Values,
    Windows,
    predict,
    references,
    steady_thrust,
    straight,
    values,
)
from twinscrew.hil_sim.identification.recorded import (
    AHEAD_S,
    DT_S,
    Piece,
    read_pieces,
    require_excitation,
)
from twinscrew.hil_sim.vessel.dynamics import join
from twinscrew.runtime.errors import ConfigError, RecordingError
from twinscrew.runtime.recording.recording import find_recordings
from twinscrew.runtime.settings import convert, load, shipped
from twinscrew.runtime.vessel_description import (
    VesselDescription,
    VesselFile,
    VesselTable,
    describe,
    load_vessel,
)

Array = NDArray[np.float64]

WORSE: Final = 1.5
"""[-] A file that predicts so many times as badly as a fit is out of date, ..."""
MATTERS: Final = 0.1
"""[-] ... if its error after 5 s is more than this share of the length."""
NOT_TOLD: Final = 0.6
"""[-] A number whose standard error is more than this share of what it was before, was not told."""
TWICE: Final = math.log(1.5)
"""[-] Force by mass that differs by more from the vessel's file is a contradiction."""


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
    """Whether the trials told it; else it is still about what the vessel's file says."""


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
    """How mass and thrust of the vessel's file contradict the trials; empty if they do not."""
    outdated: str
    """How much worse the file predicts than what was identified; empty if it does not matter."""
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
            "outdated": self.outdated,
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
    theta, _ = problem.fit(train, begin=given)
    validation, before = (_validation(problem, x, test) for x in (theta, given))
    final, covariance = problem.fit(windows, begin=theta)
    draws = np.random.default_rng(0).multivariate_normal(final, covariance, size=400)
    draws = np.clip(draws, -4.0 * problem.sigma, 4.0 * problem.sigma)
    told = np.sqrt(np.diag(covariance)) < NOT_TOLD * problem.sigma
    estimates = _estimates(problem, final, draws, told)
    table = _table(problem, final)
    try:
        described = describe(table_of(table), key=known.key)
    except ConfigError as error:
        raise ConfigError(f"what was identified is no vessel: {error}") from error
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
        contradiction=_contradiction(problem, final, draws),
        outdated=_outdated(known, validation, before),
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
    wrong = found.contradiction or found.outdated
    return not wrong, f"{words}; {wrong}" if wrong else words


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
    at = np.array(references(problem.prior.vessel))
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
    missing = [text for name, text in words.items() if not told[problem.names.index(name)]]
    fixed = "mass and thrust are told only by their ratio: the mass is the file's"
    return [fixed, *([f"the trials do not tell {', '.join(missing)}"] if missing else [])]


def _contradiction(problem: Problem, theta: Array, draws: Array) -> str:
    """Say how the file contradicts the trials by its force per mass."""
    vessel = problem.prior.vessel
    ratios = [
        values(x, problem.prior).full[:, 0] / values(x, problem.prior).mass[:, 0]
        for x in (theta[None], draws)
    ]
    known = vessel.thrusters.max_n / vessel.plane_inertia[0]
    share = float(ratios[0][0] / known)
    low, high = (float(np.percentile(ratios[1], q) / known) for q in (2.5, 97.5))
    if abs(math.log(share)) > TWICE and not low <= 1.0 <= high:
        return (
            f"full thrust accelerates the boat {share:.2f} times ({low:.2f} to {high:.2f}) as much "
            f"as the file's mass_kg = {vessel.mass_kg:g} and thrust_max_n = "
            f"{vessel.thrusters.max_n:g} say: if the thrust is right, the mass is "
            f"{vessel.mass_kg / share:.3g} kg; if the mass is right, the thrust is "
            f"{vessel.thrusters.max_n * share:.3g} N"
        )
    return ""


def _outdated(vessel: VesselDescription, fitted: Validation, given: Validation) -> str:
    """Say how much worse the file predicts than what fits, if that matters."""
    ratio = given.position_rmse_5s_m / max(fitted.position_rmse_5s_m, 1e-9)
    if ratio < WORSE or given.position_rmse_5s_m < MATTERS * vessel.length_m:
        return ""
    return (
        f"the file's vessel predicts 5 s {ratio:.1f} times as badly as one that fits "
        f"({given.position_rmse_5s_m:.2f} m, {fitted.position_rmse_5s_m:.2f} m): "
        "identify it again"
    )


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
        (
            "added_mass",
            np.array([*(mass[:2] - vessel.mass_kg), mass[2] - yaw_own - offset]),
            vessel.added_mass,
        ),
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
    try:
        table = load(shipped("vessels", vessel.key), VesselFile).vessel
    except ConfigError:
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
    inner = {
        key: _said(value) if isinstance(value, dict) else value for key, value in table.items()
    }
    return {key: value for key, value in inner.items() if value not in (None, {}, [], ())}


def _curve(found: Values, ahead: float, astern: float) -> list[list[float]]:
    """Give the thrust curve as a vessel's file has it: pairs of command and newtons."""
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    for sign, side, full in ((1.0, 0, ahead), (-1.0, 1, astern)):
        dead = round(float(found.dead[0, side]), 4)
        if dead < 0.002:
            dead = 0.0
        else:
            points.append((sign * dead, 0.0))
        rows = range(4, len(GRID), 4)
        for at, share in zip(GRID[rows], found.curve[0, side, rows], strict=True):
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
    measured = test.measured[:, STEPS - 1 :: STEPS]
    off = both[..., :2] - measured[None, ..., :2]
    command = np.linspace(-1.0, 1.0, 81)
    every = values(np.vstack([final, draws[:200]]), problem.prior)
    curves = np.array([steady_thrust(every, row, command) for row in range(201)])
    known = np.array(problem.prior.vessel.thrusters.curve or straight(problem.prior.vessel))
    band = np.percentile(curves[1:], (2.5, 97.5), axis=0)
    return Shown(
        time_s=times[test.at] - times[0],
        measured=measured,
        identified=both[0],
        given=both[1],
        error_m=np.sqrt((off**2).sum(axis=-1).mean(axis=1)),
        command=command,
        curves=np.vstack([np.interp(command, *known.T), curves[0], band]),
    )

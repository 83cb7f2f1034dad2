"""Identification tried on hulls that nobody has seen: truth against estimate.

    python -m twinscrew.hil_sim.identification.hulls --seeds 1,2,3 --out runs/hulls

Each hull is drawn by its seed: 1 to 10 m, with its own drag, lag, dead band and bent thrust curve.
Its runtime is told only the eight least keys, with a thrust and a top speed that are up to 20 %
wrong. It sails trials of 5 minutes in the paper's wind and waves and a current; what is identified
from the recording is then compared with the truth, both in the simulator on calm water.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomli_w
from numpy.typing import NDArray

from twinscrew.hil_sim.identification.figure import draw
from twinscrew.hil_sim.identification.identify import Identification, identify
from twinscrew.hil_sim.scenario import load_scenario, on_trial
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest, still_water
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings, thrust_from_fraction
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.hull_settings import paddles
from twinscrew.runtime.vessel_description import VesselDescription

Array = NDArray[np.float64]

TRIAL_S: Final = 300.0
STEP_S: Final = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Performance:
    """What a vessel does on calm water, in the simulator with six degrees of freedom."""

    top_speed_mps: float
    turning_rate_radps: float
    """Steady, left full ahead, right at rest."""
    stopping_way_m: float
    """From top speed, both full astern, until it stands."""

    def errors(self, truth: Performance) -> dict[str, float]:
        """Give each number's relative error."""
        return {name: getattr(self, name) / getattr(truth, name) - 1.0 for name in truth.__slots__}


def performance(vessel: VesselDescription) -> Performance:
    """Measure a vessel in the simulator, by commands as shares of full."""
    dynamics, sea = VesselDynamics(vessel), still_water()
    scale = convert(paddles(vessel), PaddleSettings)
    unit_s = vessel.length_m / vessel.top_speed_mps

    def sailed(state: Any, left: float, right: float, time_s: float) -> list[Any]:
        command = np.array([[thrust_from_fraction(share, scale) for share in (left, right)]])
        states = [state]
        for step in range(round(time_s / STEP_S)):
            states.append(dynamics.step(states[-1], command, sea, step * STEP_S, STEP_S))
        return states

    rest = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    constant_s = vessel.plane_inertia[0] * vessel.top_speed_mps / (2.0 * vessel.thrusters.max_n)
    long_s = max(40.0 * unit_s, 8.0 * constant_s)
    ahead = sailed(rest, 1.0, 1.0, long_s)
    turning = sailed(rest, 1.0, 0.0, long_s)
    stopping = sailed(ahead[-1], -1.0, -1.0, long_s)
    surge = np.array([state.velocity_B[0, 0] for state in stopping])
    stands = int(np.argmax(surge <= 0.0)) or len(surge) - 1
    way = stopping[stands].position_N[0, :2] - stopping[0].position_N[0, :2]
    rates = [state.rates_B[0, 2] for state in turning[-round(3.0 * unit_s / STEP_S) :]]
    return Performance(
        top_speed_mps=float(ahead[-1].velocity_B[0, 0]),
        turning_rate_radps=float(np.mean(rates)),
        stopping_way_m=float(np.hypot(*way)),
    )


def made_up(seed: int) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Draw a hull, what its owner knows of it, and a sea: three tables."""
    rng = np.random.default_rng([2026, seed])
    length = float(np.exp(rng.uniform(0.0, math.log(10.0))))
    beam = length * rng.uniform(0.32, 0.6)
    mass = 14.0 * length**2.3 * rng.uniform(0.7, 1.6)
    top = math.sqrt(9.81 * length) * rng.uniform(0.35, 0.6)
    ahead = 0.5 * mass * 9.81 * rng.uniform(0.12, 0.35)
    astern = -ahead * rng.uniform(0.4, 1.0)
    least = {
        "name": f"hull {seed}",
        "length_m": round(length, 3),
        "beam_m": round(beam, 3),
        "mass_kg": round(mass, 2),
        "thruster_spacing_m": round(beam * rng.uniform(0.55, 0.85), 3),
        "thrust_max_n": round(ahead, 2),
        "thrust_min_n": round(astern, 2),
        "top_speed_mps": round(top, 3),
    }
    vessel = _described(least)
    thrusters = {
        "time_constant_s": round(rng.uniform(0.05, 0.5), 3),
        "curve": _curve(rng, least["thrust_max_n"], least["thrust_min_n"]),
    }
    share = rng.uniform(0.05, 0.6)
    drag = 2.0 * ahead
    sway, yaw = rng.uniform(0.5, 2.0, 2), rng.uniform(0.5, 2.0, 2)
    truth = least | {
        "thrusters": thrusters,
        "linear_drag": {
            "surge": share * drag / top,
            "sway": sway[0] * vessel.linear_drag[1],
            "yaw": yaw[0] * vessel.linear_drag[5],
        },
        "quadratic_drag": {
            "surge": (1.0 - share) * drag / top**2,
            "sway": sway[1] * vessel.quadratic_drag[1],
            "yaw": yaw[1] * vessel.quadratic_drag[5],
        },
        "added_mass": {
            "surge": rng.uniform(0.3, 2.0) * vessel.added_mass[0],
            "sway": rng.uniform(0.3, 2.0) * vessel.added_mass[1],
            "yaw": rng.uniform(0.6, 1.6) * vessel.added_mass[5],
        },
        "inertia": {"yaw_kgm2": rng.uniform(0.7, 1.4) * mass * (0.25 * length) ** 2},
    }
    wrong = rng.uniform(0.8, 1.2, 3)
    known = least | {
        "thrust_max_n": round(ahead * wrong[0], 2),
        "thrust_min_n": round(astern * wrong[1], 2),
        "top_speed_mps": round(top * min(wrong[2], 1.1), 3),
    }
    way = rng.uniform(-math.pi, math.pi)
    speed = 0.15 * top * rng.uniform(0.0, 1.0)
    sea = {"current_mps": [speed * math.cos(way), speed * math.sin(way)]}
    plain: tuple[dict[str, Any], dict[str, Any], dict[str, Any]]
    plain = tuple(json.loads(json.dumps(table)) for table in (truth, known, sea))  # no numpy
    return plain


def _described(table: dict[str, Any]) -> VesselDescription:
    from twinscrew.hil_sim.identification.identify import table_of
    from twinscrew.runtime.vessel_description import describe

    return describe(table_of(table))


def _curve(rng: np.random.Generator, ahead: float, astern: float) -> list[list[float]]:
    """Draw a bent curve: a dead band, and a power of the rest, either side its own."""
    points = [[0.0, 0.0]]
    for sign, full in ((1.0, ahead), (-1.0, -astern)):
        dead, power = rng.uniform(0.0, 0.1), rng.uniform(0.8, 2.2)
        points.append([round(sign * dead, 4), 0.0])
        for at in np.linspace(0.1, 1.0, 10):
            command = round(sign * (dead + (1.0 - dead) * float(at)), 4)
            points.append([command, sign * full * float(at) ** power])
    points.sort()
    points[0], points[-1] = [-1.0, astern], [1.0, ahead]
    return points


def try_hull(seed: int, folder: Path) -> dict[str, Any]:
    """Sail a hull's trials, identify it, and give truth and estimate."""
    folder.mkdir(parents=True, exist_ok=True)
    truth, known, sea = made_up(seed)
    files = {name: folder / f"{name}.toml" for name in ("truth", "known", "sea", "scenario")}
    files["truth"].write_text(tomli_w.dumps({"vessel": truth}))
    files["known"].write_text(tomli_w.dumps({"vessel": known}))
    files["sea"].write_text(tomli_w.dumps(sea))
    scenario = {"sea": str(files["sea"].resolve()), "random": {"vessels": 1}}
    files["scenario"].write_text(tomli_w.dumps(scenario))
    made = load_scenario(files["scenario"], 1, seed=seed, types=[str(files["truth"])])
    settings = SitlSettings(
        trial="all",
        trial_time_s=TRIAL_S,
        believed=str(files["known"]),
        seed=seed,
        sensor="vrx16",
        lockstep=True,
    )
    run = folder / "run"
    report = sail(on_trial(made, "all", TRIAL_S), settings, run)
    found = identify([run], str(files["known"]))
    (folder / "identified.toml").write_text(tomli_w.dumps({"vessel": found.table}))
    draw(found, folder / "identified.png")
    return _row(seed, truth, found, report.vessels[0].outcome, sea)


def _row(
    seed: int, truth: dict[str, Any], found: Identification, outcome: str, sea: dict[str, Any]
) -> dict[str, Any]:
    real = _described(truth)
    is_so, seems = performance(real), performance(found.vessel)
    drawn = {
        "surge_mass_kg": real.plane_inertia[0],
        "sway_mass_kg": real.plane_inertia[1],
        "yaw_inertia_kgm2": real.plane_inertia[2],
        "thrust_max_n": real.thrusters.max_n,
        "thrust_min_n": real.thrusters.min_n,
        "lag_s": real.thrusters.time_constant_s,
    }
    return {
        "seed": seed,
        "length_m": real.length_m,
        "mass_kg": real.mass_kg,
        "outcome": outcome,
        "seconds": found.seconds,
        "current_mps": sea["current_mps"],
        "weather": list(found.weather),
        "truth": {name: getattr(is_so, name) for name in is_so.__slots__},
        "identified": {name: getattr(seems, name) for name in seems.__slots__},
        "error": seems.errors(is_so),
        "position_5s_in_lengths": found.validation.position_rmse_5s_m / real.length_m,
        "given_5s_in_lengths": found.given.position_rmse_5s_m / real.length_m,
        "contradiction": found.contradiction,
        "numbers": {
            name: {"truth": value, **found.as_dict()["estimates"][name]}
            for name, value in drawn.items()
        },
    }


def main() -> None:
    """Try hulls one after another, and write a line of JSON for each."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", default="1,2,3,4,5,6")
    parser.add_argument("--out", type=Path, default=Path("runs/hulls"))
    asked = parser.parse_args()
    for seed in (int(word) for word in asked.seeds.split(",")):
        row = try_hull(seed, asked.out / f"hull_{seed}")
        (asked.out / f"hull_{seed}" / "row.json").write_text(json.dumps(row, indent=1) + "\n")
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()

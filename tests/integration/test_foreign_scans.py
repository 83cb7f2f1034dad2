"""Scans of sensors as they really fire, through files and the command line: nothing is missed.

The scans come from equations (``tests/reference/scans.py``), not from the simulator.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from numpy.random import Generator
from tests.reference.scans import FIRINGS, Scan, Thing, scan
from typer.testing import CliRunner

from twinscrew.hil_sim.perceive.command import perceive

pytestmark = pytest.mark.slow

FEWEST = 25
"""[-] Of things that show fewer echoes nothing is asked."""
RANGE_M = 20.0
HEIGHT_M = 1.9


def things(rng: Generator) -> list[Thing]:
    """Buoys, boats, boxes and drums, 4 to 18 m off, no two nearer than 2 m."""
    placed: list[Thing] = []
    for kind in rng.integers(0, 4, 9).tolist():
        for _ in range(100):
            bearing, distance = rng.uniform(-np.pi, np.pi), rng.uniform(4.0, 18.0)
            size = [
                (rng.uniform(0.35, 0.8),),
                (rng.uniform(4.0, 6.0), rng.uniform(1.8, 2.5)),
                (rng.uniform(1.0, 2.0), rng.uniform(1.0, 2.0)),
                (rng.uniform(1.0, 2.0),),
            ][kind]
            new = Thing(
                x=distance * np.cos(bearing),
                y=distance * np.sin(bearing),
                size=size,
                low=0.0,
                high=rng.uniform(1.0, 3.0),
                turn=rng.uniform(0.0, np.pi),
            )
            if distance - new.reach > 2.5 and all(_gap(new, old) > 2.0 for old in placed):
                placed.append(new)
                break
    return placed


def _gap(a: Thing, b: Thing) -> float:
    return float(np.hypot(a.x - b.x, a.y - b.y)) - a.reach - b.reach


def kitti(file: Path, made: Scan) -> Path:
    file = file.with_suffix(".bin")
    np.column_stack([made.points, made.intensity]).astype("<f4").tofile(file)
    return file


def nuscenes(file: Path, made: Scan) -> Path:
    file = file.with_suffix(".bin")
    np.column_stack([made.points, made.intensity, made.ring]).astype("<f4").tofile(file)
    return file


def npy(file: Path, made: Scan) -> Path:
    file = file.with_suffix(".npy")
    np.save(file, made.points)
    return file


def pcd(file: Path, made: Scan) -> Path:
    """Binary, with padding between the fields as PCL writes it."""
    file = file.with_suffix(".pcd")
    names, formats = ["x", "y", "z", "_", "ring"], ["<f4", "<f4", "<f4", "<f4", "<u2"]
    rows = np.zeros(len(made.points), np.dtype({"names": names, "formats": formats}))
    for axis, name in enumerate("xyz"):
        rows[name] = made.points[:, axis]
    rows["ring"] = made.ring
    header = (
        "VERSION 0.7\nFIELDS x y z _ ring\nSIZE 4 4 4 4 2\nTYPE F F F F U\nCOUNT 1 1 1 1 1\n"
        f"WIDTH {len(rows)}\nHEIGHT 1\nPOINTS {len(rows)}\nDATA binary\n"
    )
    file.write_bytes(header.encode() + rows.tobytes())
    return file


def score(made: Scan, present: list[Thing], objects: list[dict[str, Any]]) -> tuple[int, int, int]:
    """Give how many things there are, how many were found, and how many objects are of nothing.

    Found: an object with at least half of the thing's echoes, its centre where their mean is.
    """
    near = np.linalg.norm(made.points, axis=1) < RANGE_M
    asked = found = 0
    free = list(range(len(objects)))
    for number in range(len(present)):
        own = made.points[near & (made.thing == number)]
        if len(own) == 0:
            continue
        middle = own[:, :2].mean(axis=0)
        apart = [
            np.hypot(objects[k]["x_m"] - middle[0], objects[k]["y_m"] - middle[1]) for k in free
        ]
        best = int(np.argmin(apart)) if apart else -1
        share = objects[free[best]]["points"] / len(own) if apart else 0.0
        hit = bool(apart) and apart[best] < 0.3 and 0.5 <= share <= 1.1
        if hit:
            free.pop(best)
        if len(own) >= FEWEST:
            asked, found = asked + 1, found + hit
    return asked, found, len(free)


def perceived(file: Path, sensor: str, *more: object) -> dict[str, Any]:
    """Give what the command prints; in this process, as there are many."""
    command = typer.Typer()
    command.command()(perceive)
    words = [file, "--sensor", sensor, "--json", *more]
    finished = CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False)
    result: dict[str, Any] = json.loads(finished.stdout)
    return result


CONDITIONS: dict[str, dict[str, Any]] = {
    "tilted": {"tilt": (0.05, -0.04)},
    "no ground, misses are NaN": {"ground": False, "misses": "nan", "mixed": False},
    "a tenth is lost, misses are zero": {"dropped": 0.1, "misses": "zero"},
}
FORMATS: tuple[Callable[[Path, Scan], Path], ...] = (kitti, nuscenes, npy, pcd)


@pytest.mark.parametrize("name", FIRINGS)
def test_what_stands_around_is_found_and_nothing_else(tmp_path: Path, name: str) -> None:
    asked = found = false = 0
    for number, condition in enumerate(CONDITIONS.values()):
        for seed in range(4):
            rng = np.random.default_rng(seed)
            present = things(rng)
            made = scan(FIRINGS[name], present, rng, height=HEIGHT_M, **condition)
            file = FORMATS[(number + seed) % len(FORMATS)](tmp_path / "scan", made)
            result = perceived(file, name, "--height-m", HEIGHT_M, "--ground-m", 0.2)
            assert result["image"]["from"] == "sensor"
            a, f, wrong = score(made, present, result["objects"])
            asked, found, false = asked + a, found + f, false + wrong
    assert asked > 50
    assert found >= 0.97 * asked
    assert false < 0.01 * (found + false) + 1


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_another_rate_of_turn_is_no_other_sensor(tmp_path: Path, share: float) -> None:
    firing = replace(FIRINGS["vlp16"], columns=round(share * FIRINGS["vlp16"].columns))
    rng = np.random.default_rng(3)
    present = things(rng)
    made = scan(firing, present, rng, ground=False)
    file = npy(tmp_path / "scan", made)
    result = perceived(file, "vlp16")
    asked, found, false = score(made, present, result["objects"])
    assert asked >= 4
    assert (found, false) == (asked, 0)

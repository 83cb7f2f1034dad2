"""`twinscrew perceive` as users call it, on files as others write them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.harness import street
from tests.harness.commands import as_json, twinscrew
from tests.harness.street import CARS, POLES
from tests.reference.scans import FIRINGS, Thing, scan

pytestmark = pytest.mark.slow


def kitti_bin(file: Path) -> Path:
    points = street.like_kitti().points
    np.column_stack([points, np.full(len(points), 0.4)]).astype("<f4").tofile(file)
    return file


def nuscenes_bin(file: Path) -> Path:
    scan = street.like_nuscenes()
    np.column_stack([scan.points, np.full(len(scan.ring), 9), scan.ring]).astype("<f4").tofile(file)
    return file


def double_npy(file: Path) -> Path:
    np.save(file, street.like_vlp16().points.astype(np.float64))
    return file


def ascii_pcd(file: Path) -> Path:
    points = street.like_vlp16().points
    header = (
        "VERSION .7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
        f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA ascii"
    )
    rows = np.column_stack([points, np.ones(len(points))])
    np.savetxt(file, rows, fmt="%.4f", header=header, comments="")
    return file


@pytest.mark.parametrize(
    ("make", "name", "sensor", "height", "origin"),
    [
        (kitti_bin, "a.bin", "os1_64", 1.73, "points"),
        (nuscenes_bin, "a.bin", "hdl32e", 1.84, "sensor"),
        (double_npy, "a.npy", "vlp16", 1.5, "sensor"),
        (ascii_pcd, "a.pcd", "vlp16", 1.5, "sensor"),
    ],
)
def test_cars_and_poles_are_printed_where_they_stand_in_the_files_axes(
    tmp_path: Path,
    make: Callable[[Path], Path],
    name: str,
    sensor: str,
    height: float,
    origin: str,
) -> None:
    file = make(tmp_path / name)
    land = ("--height-m", height, "--ground-m", 0.3)
    result = as_json(twinscrew("perceive", file, "--sensor", sensor, *land, "--json"))
    assert result["image"]["from"] == origin
    assert result["used_points"] <= result["points"]
    assert result["used_points"] + sum(result["left_out"].values()) == result["points"]
    assert result["time_ms"] > 0
    places = np.array([(o["x_m"], o["y_m"]) for o in result["objects"]])
    # The visible side of a car may be half its length off its middle.
    for place, reach in [(p, 2.3) for p in CARS] + [(p, 0.6) for p in POLES]:
        assert np.hypot(*(places - place).T).min() < reach, place


def test_ground_that_is_kept_is_told_of(tmp_path: Path) -> None:
    file = nuscenes_bin(tmp_path / "a.bin")
    result = as_json(twinscrew("perceive", file, "--sensor", "hdl32e", "--json"))
    assert result["left_out"]["water"] == 0
    (note,) = result["notes"]
    assert "--height-m 1.8" in note


def test_a_picture_and_a_table_are_made(tmp_path: Path) -> None:
    picture = tmp_path / "a.png"
    file = kitti_bin(tmp_path / "a.bin")
    done = twinscrew("perceive", file, "--sensor", "hdl32e", "--height-m", 1.7, "--plot", picture)
    assert done.returncode == 0, done.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "radius_m" in done.stdout
    assert "derived from the" in done.stdout


def test_an_empty_file_is_an_empty_scan(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(b"")
    done = twinscrew("perceive", tmp_path / "a.bin", "--sensor", "vlp16", "--json")
    result = as_json(done)
    assert (result["objects"], result["points"], result["used_points"]) == ([], 0, 0)


@pytest.mark.parametrize(
    ("name", "data", "words", "said"),
    [
        ("a.bin", b"12345", ("--sensor", "vlp16"), "no float32"),
        ("a.bin", b"", ("--sensor", "sonar"), "hdl32e"),
        ("a.npy", b"PK", ("--sensor", "vlp16"), "not an npy"),
        ("a.bin", b"", ("--sensor", "vlp16", "--max-range-m", "-3"), "max_range_m"),
        ("a.bin", b"", ("--sensor", "vlp16", "--height-m", "-2"), "--height-m"),
    ],
)
def test_what_cannot_be_perceived_is_refused_in_one_line(
    tmp_path: Path, name: str, data: bytes, words: tuple[str, ...], said: str
) -> None:
    (tmp_path / name).write_bytes(data)
    done = twinscrew("perceive", tmp_path / name, *words)
    assert done.returncode not in (0, 1)
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_nan_and_infinity_are_no_points(tmp_path: Path) -> None:
    points = street.like_vlp16().points
    points[::2] = np.nan
    points[1::6] = np.inf
    np.save(tmp_path / "a.npy", points)
    done = twinscrew("perceive", tmp_path / "a.npy", "--sensor", "vlp16", "--json")
    result = json.loads(done.stdout)
    assert result["left_out"]["empty"] == len(points[::2]) + len(points[1::6])


def test_noise_for_a_file_is_read_without_a_word(tmp_path: Path) -> None:
    file = tmp_path / "noise.bin"
    file.write_bytes(np.random.default_rng(0).bytes(16 * 500))
    finished = twinscrew("perceive", file, "--sensor", "vlp16", "--height-m", 1.5, "--json")
    assert finished.stderr == ""
    result = as_json(finished)
    assert result["points"] in (400, 500)  # rows of five or of four
    assert result["surface"] is None


def boat_scan(file: Path) -> Path:
    """A post 8 m ahead of a LiDAR 1.9 m over the water, its own bow 1 m ahead, and water."""
    made = scan(
        FIRINGS["vlp16"],
        [
            Thing(x=8.0, y=0.0, size=(0.4,), low=0.0, high=3.0, turn=0.0),
            Thing(x=1.5, y=0.0, size=(0.8, 1.6), low=0.0, high=1.5, turn=0.0),
        ],
        np.random.default_rng(0),
        height=1.9,
    )
    np.save(file, made.points)
    return file


def test_the_own_hull_is_masked_where_it_is_given(tmp_path: Path) -> None:
    file = boat_scan(tmp_path / "a.npy")
    words = ("perceive", file, "--sensor", "vlp16", "--height-m", 1.9, "--json")
    seen = as_json(twinscrew(*words))
    assert len(seen["objects"]) == 2
    masked = as_json(twinscrew(*words, "--hull-m", -2.0, 2.2, 1.2))
    assert masked["left_out"]["hull"] > 100
    (post,) = masked["objects"]
    assert post["x_m"] == pytest.approx(7.6, abs=0.2)


def test_sensor_hull_and_height_follow_from_a_boats_configuration(tmp_path: Path) -> None:
    file, config = boat_scan(tmp_path / "a.npy"), tmp_path / "boat.toml"
    config.write_text(
        'sensor = "vlp16"\n[mount]\nx_m = 0.5\ny_m = 0.0\nz_m = 2.0\n'
        "[perception.hull]\naft_m = -2.5\nfore_m = 2.7\nhalf_width_m = 1.2\n"
        "[perception.water]\nsurface_m = 0.1\n"
    )
    given = as_json(twinscrew("perceive", file, "--config", config, "--json"))
    assert given["surface"]["height_m"] == pytest.approx(1.9, abs=0.05)
    assert given["left_out"]["hull"] > 100
    assert given["left_out"]["water"] > 100
    (post,) = given["objects"]
    assert (post["x_m"], post["y_m"]) == pytest.approx((7.6, 0.0), abs=0.2)


def test_without_sensor_and_configuration_it_says_what_is_needed(tmp_path: Path) -> None:
    done = twinscrew("perceive", boat_scan(tmp_path / "a.npy"))
    assert done.returncode == 2
    assert "--sensor" in done.stderr
    assert "--config" in done.stderr

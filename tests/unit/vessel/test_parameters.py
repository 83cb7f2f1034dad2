"""Vessel files: read, checked, turned to forward-starboard-down."""

from pathlib import Path

import numpy as np
import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import CONFIG_DIR
from twinscrew.runtime.vessel_description import largest_lift, load_vessel

WAM_V = CONFIG_DIR / "vessels" / "wam_v.toml"


def changed(folder: Path, old: str, new: str) -> Path:
    text = WAM_V.read_text()
    assert text.count(old) >= 1
    file = folder / "changed.toml"
    file.write_text(text.replace(old, new, 1))
    return file


def test_the_shipped_vessel_has_the_papers_thrust_range():
    thrusters = load_vessel().thrusters
    assert (thrusters.min_n, thrusters.max_n) == (-500.0, 1000.0)


def test_the_left_propeller_is_to_port_and_below_the_origin():
    left, right = load_vessel().thrusters.positions_B
    np.testing.assert_allclose(left, [-2.651932, -1.027135, 0.191134])
    np.testing.assert_allclose(right, [-2.651932, 1.027135, 0.191134])


def test_a_part_above_the_deck_has_a_negative_down_coordinate():
    cases = next(part for part in load_vessel().parts if part.name == "CPU cases")
    np.testing.assert_allclose(cases.position_B, [-0.15, 0.0, -1.53])


def test_largest_lift_is_half_a_hull_of_half_a_circle():
    # 0.5 pi r^2 L / 2 rho g
    expected = 0.5 * np.pi * 0.213**2 * 4.9 / 2 * 997.7735 * 9.81
    assert largest_lift(load_vessel().buoyancy) == pytest.approx(expected, rel=1e-12)


def test_an_unknown_key_is_refused_by_name(tmp_path):
    file = changed(tmp_path, "length_m =", "lenght_m = 5.0\nlength_m =")
    with pytest.raises(ConfigError, match="lenght_m"):
        load_vessel(file)


def test_a_negative_drag_is_refused(tmp_path):
    file = changed(tmp_path, "surge = 100.0", "surge = -100.0")
    with pytest.raises(ConfigError, match=r"linear_drag\.surge"):
        load_vessel(file)


def test_a_vessel_that_sinks_is_refused(tmp_path):
    file = changed(tmp_path, "hull_radius_m = 0.213", "hull_radius_m = 0.13")
    with pytest.raises(ConfigError, match="sinks"):
        load_vessel(file)


def test_an_unknown_vessel_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError, match="wam_v"):
        load_vessel("titanic")


@pytest.mark.parametrize("line", ["hull_length_m = 4.9", "hull_radius_m = 0.213"])
def test_a_hull_longer_than_any_ship_is_refused_by_key(tmp_path: Path, line: str) -> None:
    key = line.partition(" ")[0]
    with pytest.raises(ConfigError, match=rf"buoyancy\.{key}: .*<= 500"):
        load_vessel(changed(tmp_path, line, f"{key} = 1e300"))

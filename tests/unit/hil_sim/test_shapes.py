from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from twinscrew.hil_sim.shapes import (
    BOX,
    CYLINDER,
    BoxPart,
    CylinderPart,
    Shape,
    ShapeFile,
    boxes_shape,
    load_shape,
    make_shape,
    vessel_shape,
)
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.vessel_description import load_vessel


def extent(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest coordinates of the solids' corner boxes, in B."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = shape.centres[:, None] + np.einsum(
        "pij,pcj->pci", shape.rotations, signs[None] * shape.halves[:, None]
    )
    return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))


@pytest.mark.parametrize("name", ["wam_v", "workboat", "light_buoy"])
def test_solids_have_proper_axes_and_sizes(name: str) -> None:
    shape = load_shape(name) if name == "light_buoy" else vessel_shape(load_vessel(name))
    turned = np.einsum("pij,pik->pjk", shape.rotations, shape.rotations)
    np.testing.assert_allclose(turned, np.broadcast_to(np.eye(3), turned.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(shape.rotations), 1.0)
    assert (shape.halves > 0).all()
    round_ones = shape.kinds == CYLINDER
    np.testing.assert_array_equal(shape.halves[round_ones, 1], shape.halves[round_ones, 2])


def test_a_wam_v_is_five_metres_long_two_and_a_half_wide_and_symmetric() -> None:
    shape = vessel_shape(load_vessel())
    low, high = extent(shape)
    np.testing.assert_allclose(high - low, [5.2, 2.46, 2.27], atol=0.05)
    assert low[1] == pytest.approx(-high[1])
    mirrored = {tuple(np.round(c * [1, -1, 1], 6)) for c in shape.centres}
    assert mirrored == {tuple(np.round(c, 6)) for c in shape.centres}


def test_the_highest_part_of_a_wam_v_ends_at_its_lidar() -> None:
    low, _ = extent(vessel_shape(load_vessel()))
    assert low[2] == pytest.approx(-1.93)


def test_the_bows_rise_and_the_engines_reach_into_the_water() -> None:
    shape = vessel_shape(load_vessel())
    front = shape.centres[:, 0].argmax()
    axis = shape.rotations[front, :, 0]
    assert axis[0] * axis[2] < 0  # forward is up, and up is negative
    engine = shape.centres[:, 0].argmin()
    assert shape.centres[engine, 2] + shape.halves[engine, 2] > 0.3


def test_a_mirrored_part_is_the_mirror_image_of_every_point() -> None:
    part = BoxPart(
        centre_m=(1.0, -2.0, 3.0), size_m=(0.4, 0.6, 0.8), rpy_rad=(0.3, -0.5, 0.7), mirrored=True
    )
    port, starboard = range(2)
    shape = make_shape(ShapeFile(box=(part,)))
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T

    def corners(i: int) -> set[tuple[float, ...]]:
        points = shape.centres[i] + (signs * shape.halves[i]) @ shape.rotations[i].T
        return {tuple(np.round(p, 9)) for p in points}

    flipped = {(x, -y, z) for x, y, z in corners(port)}
    assert flipped == corners(starboard)


def test_a_cylinder_lies_along_its_axis() -> None:
    part = CylinderPart(centre_m=(0.0, 0.0, 0.0), axis=(0.0, 3.0, -4.0), length_m=2.0, radius_m=0.1)
    shape = make_shape(ShapeFile(cylinder=(part,)))
    np.testing.assert_allclose(shape.rotations[0, :, 0], [0.0, 0.6, -0.8])
    np.testing.assert_array_equal(shape.halves, [[1.0, 0.1, 0.1]])


def test_fixed_boxes_turn_clockwise() -> None:
    shape = boxes_shape(np.zeros((1, 3)), np.array([[4.0, 2.0, 1.0]]), np.array([np.pi / 2]))
    np.testing.assert_allclose(shape.rotations[0, :, 0], [0.0, 1.0, 0.0], atol=1e-12)  # to the east
    np.testing.assert_array_equal(shape.halves, [[2.0, 1.0, 0.5]])
    assert shape.kinds.tolist() == [BOX]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "at least one box or cylinder"),
        ("[[box]]\ncentre_m = [0, 0, 0]\nsize_m = [1, 0, 1]\n", "size_m"),
        (
            '[[cylinder]]\nname = "mast"\ncentre_m = [0, 0, 0]\naxis = [0, 0, 0]\nlength_m = 1\n'
            "radius_m = 1\n",
            "mast.axis: must not be the zero vector",
        ),
    ],
)
def test_a_shape_that_is_none_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "odd_shape.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as caught:
        load_shape(path)
    assert "odd_shape.toml" in str(caught.value)

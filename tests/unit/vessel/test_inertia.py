"""The sum of the parts."""

import numpy as np
import pytest

from twinscrew.hil_sim.vessel.dynamics import join, skew
from twinscrew.runtime.vessel_description import Part, load_vessel


def point(mass: float, x: float, y: float, z: float) -> Part:
    return Part(name="p", mass_kg=mass, position_m=(x, y, z), inertia_kgm2=(0, 0, 0))


def test_skew_is_the_cross_product():
    a, b = np.array([1.0, -2.0, 3.0]), np.array([0.5, 4.0, -1.0])
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b))


def test_two_points_make_a_dumbbell():
    body = join([point(2.0, 1.0, 0.0, 0.0), point(2.0, -1.0, 0.0, 0.0)])
    assert body.mass == 4.0
    np.testing.assert_allclose(body.centre_B, np.zeros(3))
    np.testing.assert_allclose(body.inertia_B, np.diag([0.0, 4.0, 4.0]))


def test_the_wam_v_weighs_what_its_parts_weigh():
    body = join(load_vessel().parts)
    assert body.mass == pytest.approx(180 + 2 * 23.5 + 2 * 15.5 + 20 + 2)


def test_the_wam_v_is_the_same_on_both_sides():
    body = join(load_vessel().parts)
    assert body.centre_B[1] == pytest.approx(0.0, abs=1e-12)
    assert body.inertia_B[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert body.inertia_B[1, 2] == pytest.approx(0.0, abs=1e-12)


def test_its_centre_of_gravity_is_aft_and_above_the_keel():
    x, _, z = join(load_vessel().parts).centre_B
    assert -0.4 < x < 0.0
    assert -0.5 < z < 0.0


def test_the_mass_matrix_gives_the_kinetic_energy_of_points():
    parts = [point(3.0, 1.0, 2.0, -1.0), point(5.0, -2.0, 0.5, 0.3), point(1.0, 0.0, -1.0, 2.0)]
    v, w = np.array([1.0, -0.5, 0.2]), np.array([0.3, 0.1, -0.7])
    nu = np.concatenate([v, w])
    speeds = [v + np.cross(w, part.position_B) for part in parts]
    energy = sum(0.5 * part.mass_kg * s @ s for part, s in zip(parts, speeds, strict=True))
    assert 0.5 * nu @ join(parts).mass_matrix() @ nu == pytest.approx(energy, rel=1e-12)

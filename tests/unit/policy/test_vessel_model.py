"""The 3-DoF model against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import asdict

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.vessel_description import load_vessel

MODEL = VesselModel()
NO_DRAG = VesselParameters(x_u=0.0, y_v=0.0, n_r=0.0, x_uu=0.0, y_vv=0.0, n_rr=0.0)


def sail(model: VesselModel, nu: list[float], thrust: list[float], seconds: float, dt: float):
    pose, velocity = np.zeros(3), np.array(nu)
    for _ in range(round(seconds / dt)):
        pose, velocity = model.step(pose, velocity, np.array(thrust), dt)
    return pose, velocity


def terminal(force: float, linear: float, quadratic: float) -> float:
    """Solve force = linear x + quadratic x^2."""
    return (math.sqrt(linear**2 + 4 * quadratic * force) - linear) / (2 * quadratic)


def test_the_defaults_are_the_default_vessels_plane_model() -> None:
    assert asdict(VesselParameters()) == asdict(load_vessel().plane)


def test_the_inertia_is_that_of_the_reference() -> None:
    assert VesselParameters().inertia == (380.0, 400.0, 1430.0)
    assert VesselParameters().radius == pytest.approx(2.795, abs=5e-4)


def test_the_top_speed_is_where_full_thrust_and_drag_balance() -> None:
    assert VesselParameters().top_speed == pytest.approx(terminal(2000.0, 100.0, 150.0))
    assert VesselParameters(x_uu=0.0).top_speed == pytest.approx(20.0)
    assert NO_DRAG.top_speed == math.inf


@pytest.mark.parametrize(("thrust", "speed"), [(1000.0, 3.3), (-500.0, -2.3)])
def test_full_thrust_ends_at_the_terminal_speed_of_the_paper(thrust: float, speed: float) -> None:
    _, nu = sail(MODEL, [0, 0, 0], [thrust, thrust], 60.0, 0.05)
    expected = math.copysign(terminal(abs(2 * thrust), 100.0, 150.0), thrust)
    assert nu[0] == pytest.approx(expected, rel=1e-9)
    assert nu[0] == pytest.approx(speed, abs=0.06)


def test_opposite_thrusts_turn_on_the_spot_at_the_closed_form_rate() -> None:
    pose, nu = sail(MODEL, [0, 0, 0], [500.0, -500.0], 60.0, 0.05)
    assert nu[2] == pytest.approx(terminal(1000.0 * 1.25, 980.0, 950.0), rel=1e-9)
    assert pose[2] > 0.0  # more thrust to port turns clockwise
    assert np.allclose(pose[:2], 0.0)


def test_linear_drag_alone_slows_exponentially() -> None:
    model = VesselModel(VesselParameters(x_uu=0.0))
    _, nu = sail(model, [2.0, 0, 0], [0, 0], 5.0, 0.001)
    assert nu[0] == pytest.approx(2.0 * math.exp(-100.0 / 380.0 * 5.0), rel=2e-3)


@pytest.mark.slow
def test_without_drag_and_thrust_the_kinetic_energy_stays() -> None:
    """C(nu) is skew-symmetric: it does no work (Fossen (2021), property 3.2)."""
    nu0 = [1.5, -0.4, 0.6]
    inertia = np.array(NO_DRAG.inertia)
    _, nu = sail(VesselModel(NO_DRAG), nu0, [0, 0], 5.0, 1e-4)
    assert abs(nu[0] - nu0[0]) > 0.1  # the components do change
    assert inertia @ nu**2 == pytest.approx(inertia @ np.square(nu0), rel=1e-3)


def test_with_drag_the_energy_falls_by_the_work_of_the_drag() -> None:
    nu, dt = np.array([2.0, 0.5, 0.4]), 1e-6
    rate = MODEL.acceleration(nu, np.zeros(3))
    p = MODEL.parameters
    power = np.array(p.inertia) @ (nu * rate)
    drag = (np.array(p.linear_drag) + np.array(p.quadratic_drag) * np.abs(nu)) * nu
    assert power == pytest.approx(-drag @ nu, rel=1e-9)
    assert dt > 0


@pytest.mark.slow
def test_a_vessel_coasting_through_a_frictionless_turn_keeps_its_momentum() -> None:
    """Equal inertias: the velocity over ground is that of a free body, constant."""
    free = VesselParameters(
        x_udot=0.0, n_rdot=0.0, x_u=0.0, y_v=0.0, n_r=0.0, x_uu=0.0, y_vv=0.0, n_rr=0.0
    )
    pose, _ = sail(VesselModel(free), [1.0, 0.0, 0.3], [0, 0], 10.0, 1e-4)
    assert pose[:2] == pytest.approx([10.0, 0.0], abs=0.02)
    assert pose[2] == pytest.approx(3.0)


def test_any_batch_shape_gives_what_each_vessel_gives_alone() -> None:
    generator = np.random.default_rng(0)
    pose, nu = generator.normal(size=(2, 4, 3)), generator.normal(size=(2, 4, 3))
    thrust, tau = generator.uniform(-500, 1000, (2, 4, 2)), generator.normal(size=(2, 4, 3)) * 50
    together = MODEL.step(pose, nu, thrust, 0.05, tau)
    alone = MODEL.step(pose[1, 2], nu[1, 2], thrust[1, 2], 0.05, tau[1, 2])
    for all_, one in zip(together, alone, strict=True):
        np.testing.assert_array_equal(all_[1, 2], one)


def test_thrust_follows_its_rate_within_the_limits() -> None:
    after = MODEL.apply(np.array([900.0, -400.0]), np.array([1000.0, -1000.0]), 0.5)
    assert after.tolist() == [1000.0, -500.0]


@pytest.mark.parametrize("change", [{"x_udot": 500.0}, {"thrust_min_n": 2000.0}])
def test_a_vessel_that_cannot_be_is_refused(change: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        VesselParameters(**change)

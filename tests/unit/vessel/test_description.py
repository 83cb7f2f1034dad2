"""One description, and what follows from it: laws that hold for every hull."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.reference.sailing import calm, sail

from twinscrew.hil_sim.shapes import vessel_shape
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest, equilibrium
from twinscrew.runtime import vessel_estimates as estimate
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.ardupilot.thrust import PaddleSettings, pwm_from_thrust, thrust_from_pwm
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS, Observation
from twinscrew.runtime.policy.hull_units import HullUnits, in_units, units_of
from twinscrew.runtime.policy.load import InHullUnits, load_policy
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.safety.prediction import AssuranceVessel
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel.config import RuntimeConfig, config_for, load_config
from twinscrew.runtime.vessel_description import (
    VesselDescription,
    VesselTable,
    describe,
    load_vessel,
)

SHIPPED = ("wam_v", "blueboat", "heron", "otter", "workboat")
LEAST = {
    "name": "tub",
    "length_m": 3.0,
    "beam_m": 1.4,
    "mass_kg": 150.0,
    "thruster_spacing_m": 1.0,
    "thrust_max_n": 200.0,
    "thrust_min_n": -120.0,
    "top_speed_mps": 2.5,
}


def tub(**changes: object) -> VesselDescription:
    return describe(convert(LEAST | changes, VesselTable))


@st.composite
def tables(draw: st.DrawFn) -> VesselTable:
    """Hulls of 1 to 12 m as people build them."""
    length = draw(st.floats(1.0, 12.0))
    beam = length * draw(st.floats(0.25, 0.8))
    mass = 8.0 * length**2.4 * draw(st.floats(0.5, 2.0))
    thrust = mass * draw(st.floats(0.5, 3.0))
    speed = draw(st.floats(0.25, 0.6)) * math.sqrt(9.81 * length)
    return VesselTable(
        name="drawn",
        length_m=length,
        beam_m=beam,
        mass_kg=mass,
        thruster_spacing_m=beam * draw(st.floats(0.3, 0.9)),
        thrust_max_n=thrust,
        thrust_min_n=-thrust * draw(st.floats(0.3, 1.0)),
        top_speed_mps=speed,
    )


@given(tables())
@settings(deadline=None)
def test_every_hull_has_positive_inertia_and_drag_and_floats(table: VesselTable) -> None:
    vessel = describe(table)
    assert min(vessel.plane_inertia) > 0.0
    assert min(vessel.added_mass) >= 0.0
    assert min(vessel.linear_drag) >= 0.0
    assert min(vessel.quadratic_drag) >= 0.0
    down, pitch = equilibrium(VesselDynamics(vessel))
    assert down == pytest.approx(vessel.waterline_m, abs=1e-3 * vessel.length_m)
    assert abs(pitch) < 0.02
    assert len(vessel_shape(vessel).kinds) >= 1


@given(tables())
@settings(deadline=None)
def test_full_thrust_and_drag_balance_at_the_top_speed(table: VesselTable) -> None:
    vessel = describe(table)
    assert VesselParameters(**_plane(vessel)).top_speed == pytest.approx(table.top_speed_mps)


@given(tables())
@settings(deadline=None)
def test_the_circles_cover_the_hull(table: VesselTable) -> None:
    vessel = describe(table)
    edge = [
        (x * vessel.length_m / 2, y * vessel.beam_m / 2)
        for x in np.linspace(-1, 1, 21)
        for y in (-1.0, 0.0, 1.0)
    ]
    for x, y in edge:
        assert any(math.hypot(x - ahead, y) <= radius + 2e-3 for ahead, radius in vessel.circles_m)


@given(tables(), st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.5, 0.5))
@settings(deadline=None)
def test_a_hull_moves_the_same_in_its_own_units(
    table: VesselTable, left: float, right: float, rate: float
) -> None:
    vessel = describe(table)
    units = units_of(vessel, load_vessel())
    plain = VesselModel(VesselParameters(**_plane(vessel)))
    scaled = VesselModel(in_units(vessel.plane, units))
    scale = np.array([units.speed, units.speed, 1.0 / units.time])
    nu, thrust = (
        np.array([0.5, 0.1, rate]) * scale,
        vessel.thrusters.max_n * np.array([left, right]),
    )
    at, after = plain.step(np.zeros(3), nu, thrust, 0.05 * units.time)
    same, units_after = scaled.step(np.zeros(3), nu / scale, thrust / units.force, 0.05)
    np.testing.assert_allclose(after, units_after * scale, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(at[:2], same[:2] * units.length, rtol=1e-9, atol=1e-12)


@given(tables())
@settings(deadline=None)
def test_settings_for_any_hull_are_accepted(table: VesselTable) -> None:
    from twinscrew.runtime.vessel.hull_settings import hull_settings

    config = convert(hull_settings(describe(table, key="drawn")), RuntimeConfig)
    assert config.thrust.max_n == table.thrust_max_n
    assert config.assurance.vessel == AssuranceVessel.of(describe(table))
    assert config.autopilot.paddles.ahead_N == table.thrust_max_n


def _plane(vessel: VesselDescription) -> dict[str, float | None]:
    return {key: getattr(vessel.plane, key) for key in vessel.plane.__struct_fields__}


def test_the_default_vessels_settings_are_the_defaults() -> None:
    assert config_for("wam_v") == RuntimeConfig()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_vessel_reaches_its_top_speed_in_the_simulator(name: str) -> None:
    vessel = load_vessel(name)
    dynamics = VesselDynamics(vessel)
    start = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    full = (vessel.thrusters.max_n, vessel.thrusters.max_n)
    end = sail(dynamics, start, full, calm(), 60)[-1]
    assert end.velocity_B[0, 0] == pytest.approx(vessel.top_speed_mps, rel=0.05)


def test_thrust_lags_and_slews_as_described() -> None:
    slow = dataclasses.replace(tub(), thrusters=dataclasses.replace(tub().thrusters, slew_nps=50.0))
    dynamics = VesselDynamics(slow)
    start = at_rest(dynamics, np.zeros((1, 2)), np.zeros(1))
    end = sail(dynamics, start, (200.0, 200.0), calm(), 1.0)[-1]
    assert end.thrust[0, 0] == pytest.approx(50.0, rel=1e-6)
    lagging = dataclasses.replace(
        tub(), thrusters=dataclasses.replace(tub().thrusters, time_constant_s=0.5)
    )
    dynamics = VesselDynamics(lagging)
    end = sail(dynamics, start, (200.0, 200.0), calm(), 1.0)[-1]
    assert end.thrust[0, 0] == pytest.approx(200.0 * (1.0 - math.exp(-2.0)), rel=1e-6)


@given(st.floats(-19.88, 33.6))
def test_newtons_on_the_wire_are_newtons_at_the_propeller(thrust: float) -> None:
    scale = config_for("heron").autopilot.paddles
    assert scale.curve
    steepest = max(
        abs((after[1] - before[1]) / (after[0] - before[0]))
        for before, after in zip(scale.curve[:-1], scale.curve[1:], strict=True)
    )
    back = thrust_from_pwm(pwm_from_thrust(thrust, scale), scale)
    assert back == pytest.approx(thrust, abs=steepest / 500)  # 1 us of 500


def test_a_dead_band_is_passed_over() -> None:
    curve = ((-1.0, -10.0), (-0.2, 0.0), (0.0, 0.0), (0.1, 0.0), (1.0, 20.0))
    scale = PaddleSettings(ahead_N=20.0, astern_N=10.0, curve=curve)
    assert pwm_from_thrust(0.0, scale) == 1500
    assert pwm_from_thrust(0.1, scale) >= 1550
    assert pwm_from_thrust(-0.1, scale) <= 1400


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass_kg": -5.0}, ["mass_kg", "> 0", "-5"]),
        ({"thruster_spacing_m": 0.0}, ["thruster_spacing_m", "greater than 0", "got 0"]),
        ({"thruster_spacing_m": -1.0}, ["thruster_spacing_m", "greater than 0", "got -1"]),
        (
            {"thrusters": {"left_m": [0, 0.0, 0], "right_m": [0, 1.0, 0]}},
            ["thrusters", "port", "got 0"],
        ),
        ({"top_speed_mps": 40.0}, ["top_speed_mps", "cannot go faster than", "got 40"]),
        ({"linear_drag": {"surge": 1e4}}, ["top_speed_mps", "full thrust"]),
        ({"thrust_min_n": 10.0}, ["thrust_min_n", "<= 0", "10"]),
        ({"thrusters": {"curve": [[-1, 0], [1, 1]]}}, ["curve", "must rise from"]),
        ({"buoyancy": {"hull_radius_m": 0.01}}, ["mass_kg", "sinks"]),
        ({"length": 3.0}, ["length", "unknown key"]),
    ],
)
def test_a_vessel_that_cannot_be_is_refused_with_file_key_value_and_what_is_allowed(
    tmp_path: Path, changes: dict[str, object], words: list[str]
) -> None:
    import tomli_w

    file = tmp_path / "tub.toml"
    file.write_text(tomli_w.dumps({"vessel": LEAST | changes}))
    with pytest.raises(ConfigError) as refusal:
        load_vessel(file)
    for word in [str(file), *words]:
        assert word in str(refusal.value)


@pytest.mark.parametrize("key", list(LEAST))
def test_a_missing_main_number_is_named(tmp_path: Path, key: str) -> None:
    import tomli_w

    file = tmp_path / "tub.toml"
    file.write_text(tomli_w.dumps({"vessel": {k: v for k, v in LEAST.items() if k != key}}))
    with pytest.raises(ConfigError, match=key):
        load_vessel(file)


def test_what_a_configuration_gives_wins_over_what_follows_the_hull(tmp_path: Path) -> None:
    file = tmp_path / "boat.toml"
    file.write_text('vessel = "otter"\npolicy = "mpc"\n[mission]\ngoal_radius_m = 3.0\n')
    config = load_config(file)
    assert config.mission.goal_radius_m == 3.0
    assert config.thrust.max_n == 119.7
    assert load_config(file, vessel="heron").thrust.max_n == 33.6
    file.write_text('vessel = "titanic"\n')
    with pytest.raises(ConfigError, match=r"vessel.*titanic.*'blueboat', 'heron'"):
        load_config(file)


def test_a_policy_for_another_vessel_is_refused_by_both_names() -> None:
    from twinscrew.runtime.errors import PolicyError
    from twinscrew.runtime.vessel.pipeline import make_pipeline

    with pytest.raises(PolicyError, match=r"trained for 'WAM-V 16'.*Blue Robotics BlueBoat.*mpc"):
        make_pipeline(config_for("blueboat", policy="ac_iqn_wam_v"))
    assert make_pipeline(config_for("blueboat", policy="mpc")).policy.name == "mpc"


def test_a_planner_decides_alike_for_hulls_that_are_alike() -> None:
    """A WAM-V of half the size decides the same in its own units."""
    wam = load_vessel()
    units = HullUnits(0.5, 0.8, 0.25)
    half = dataclasses.replace(
        wam,
        key="half",
        length_m=2.5,
        beam_m=1.25,
        top_speed_mps=wam.top_speed_mps * units.speed,
        thrusters=dataclasses.replace(wam.thrusters, max_n=250.0, min_n=-125.0),
        plane=in_units(wam.plane, HullUnits(2.0, 1.25, 4.0)),
    )
    np.testing.assert_allclose(units_of(half, wam), units)
    small, large = load_policy("mpc", vessel=half), load_policy("mpc")
    assert isinstance(small, InHullUnits)
    assert small.period_s == pytest.approx(0.5 * 0.8)
    ego = np.array([20.0, 5.0, 1.0, 0.1, 0.1, 300.0, 100.0], dtype=np.float32)
    objects = np.zeros((OBSERVED_OBJECTS, 5), dtype=np.float32)
    objects[0] = [8.0, 1.0, -1.0, 0.2, 2.0]
    mask = np.array([1, 0, 0, 0, 0], dtype=np.float32)
    length, speed = units.length, units.speed
    seen = Observation(ego=ego, objects=objects, mask=mask)
    as_small = Observation(
        ego=ego * np.float32([length, length, speed, speed, 1.25, 0.25, 0.25]),
        objects=objects * np.float32([length, length, speed, speed, length]),
        mask=mask,
    )
    np.testing.assert_allclose(
        small.act(as_small), large.act(seen) * units.force / units.time, rtol=1e-6
    )


def test_the_water_line_carries_the_mass() -> None:
    # Archimedes, in closed form: a half circle of water carries rho L pi r^2 a metre for both.
    full = 1025.0 * 2.0 * math.pi * 0.3**2
    assert estimate.immersion(full, 2.0, 0.3, 1025.0) == pytest.approx(0.3, abs=1e-6)
    assert estimate.immersion(1e-6, 2.0, 0.3, 1025.0) == pytest.approx(0.0, abs=1e-4)


def test_the_shipped_envelope_is_the_default_vessel_s_and_a_given_one_is_meant(tmp_path) -> None:
    (tmp_path / "harbour.toml").write_text("slow_share = 0.3\n")
    boat = tmp_path / "boat.toml"
    for text, enabled in (
        ('vessel = "heron"', False),
        ('vessel = "heron"\nenvelope = "harbour.toml"', True),
        ('vessel = "heron"\n[envelope]\nslow_share = 0.3', True),
        ('vessel = "heron"\n[envelope]\nenabled = false', False),
        ('vessel = "wam_v"', True),
    ):
        boat.write_text(f'name = "boat"\n{text}\n')
        assert load_config(boat).envelope.enabled is enabled

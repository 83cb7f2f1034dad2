"""One step at a time: commands, signs, bad input, VRX's way."""

import dataclasses

import numpy as np
import pytest
from tests.reference.sailing import calm, centred_vessel, sail, windy

from twinscrew.hil_sim.vessel.dynamics import DynamicsSettings, VesselDynamics, as_vrx, join
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.runtime.vessel_description import load_vessel

WAM_V = load_vessel()
DYNAMICS = VesselDynamics(WAM_V)
SEA = calm()


def resting(count: int = 1, heading: float = 0.0, dynamics: VesselDynamics = DYNAMICS):
    return at_rest(dynamics, np.zeros((count, 2)), np.full(count, heading))


def mass_matrix(vessel):
    return join(vessel.parts).mass_matrix() + np.diag(vessel.added_mass)


def force(state, sea=SEA, dynamics=DYNAMICS):
    """The whole force and moment on the first vessel, from its acceleration."""
    return mass_matrix(dynamics.parameters) @ dynamics.acceleration(state, sea, 0.0)[0]


def test_a_command_beyond_the_limits_is_clipped():
    after = DYNAMICS.step(resting(), np.array([[5000.0, -5000.0]]), SEA, 0.0, 0.01)
    np.testing.assert_array_equal(after.thrust, [[1000.0, -500.0]])


def test_without_lag_the_command_acts_at_once():
    after = DYNAMICS.step(resting(), np.array([[300.0, 200.0]]), SEA, 0.0, 0.01)
    np.testing.assert_array_equal(after.thrust, [[300.0, 200.0]])
    assert after.velocity_B[0, 0] > 0.0


def test_with_lag_the_thrust_follows_exponentially():
    slow = VesselDynamics(WAM_V, DynamicsSettings(thrust_lag_s=0.5))
    end = sail(slow, resting(), (400, -400), SEA, 1.0)[-1]
    np.testing.assert_allclose(end.thrust, 400 * (1 - np.exp(-2.0)) * np.array([[1, -1]]))


def test_more_thrust_to_port_turns_clockwise_and_more_to_starboard_the_other_way():
    clockwise = sail(DYNAMICS, resting(), (200, -200), SEA, 1.0)[-1]
    other = sail(DYNAMICS, resting(), (-200, 200), SEA, 1.0)[-1]
    assert clockwise.rates_B[0, 2] > 0.1
    assert other.rates_B[0, 2] == pytest.approx(-clockwise.rates_B[0, 2], rel=1e-9)


def test_the_yaw_moment_is_the_thrust_difference_times_the_arm():
    pushed = dataclasses.replace(resting(), thrust=np.array([[300.0, -100.0]]))
    moment = force(pushed)[5] - force(resting())[5]
    assert moment == pytest.approx((300.0 + 100.0) * 1.027135, rel=1e-9)


def test_thrust_below_the_deck_lifts_the_bow():
    pushed = dataclasses.replace(resting(), thrust=np.array([[1000.0, 1000.0]]))
    moment = force(pushed)[4] - force(resting())[4]
    assert moment == pytest.approx(2000.0 * 0.191134, rel=1e-9)


def test_thrust_ahead_moves_a_vessel_along_its_heading():
    end = sail(DYNAMICS, resting(heading=np.pi / 2), (500, 500), SEA, 5.0)[-1]
    north, east, _ = end.position_N[0]
    assert east > 3.0
    assert abs(north) < 1e-6


def test_the_step_does_not_change_its_input():
    before = resting(3)
    copies = [getattr(before, f.name).copy() for f in dataclasses.fields(before)]
    DYNAMICS.step(before, np.full((3, 2), 700.0), SEA, 0.0, 0.01)
    for field, copy in zip(dataclasses.fields(before), copies, strict=True):
        np.testing.assert_array_equal(getattr(before, field.name), copy)


def test_vessels_of_a_batch_do_not_influence_each_other():
    commands = np.array([[1000.0, 0.0], [-500.0, 300.0], [0.0, 0.0]])
    together = DYNAMICS.step(resting(3), commands, SEA, 0.0, 0.01)
    for i in range(3):
        alone = DYNAMICS.step(resting(1), commands[i : i + 1], SEA, 0.0, 0.01)
        np.testing.assert_array_equal(together.velocity_B[i], alone.velocity_B[0])


def test_arrays_of_any_layout_and_number_type_are_taken():
    state = resting(3)
    commands = np.array([[1000, 0], [-500, 300], [0, 0]])
    turned = dataclasses.replace(
        state,
        position_N=np.asfortranarray(state.position_N),
        velocity_B=state.velocity_B.astype(np.float32),
    )
    expected = DYNAMICS.step(state, commands.astype(np.float64), SEA, 0.0, 0.01)
    got = DYNAMICS.step(turned, commands, SEA, 0.0, 0.01)
    np.testing.assert_array_equal(got.position_N, expected.position_N)
    np.testing.assert_array_equal(got.velocity_B, expected.velocity_B)


def test_no_vessels_are_a_fleet_too():
    assert DYNAMICS.step(resting(0), np.zeros((0, 2)), SEA, 0.0, 0.01).count == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_command_that_is_not_finite_is_refused(bad):
    with pytest.raises(ValueError, match="command must be finite"):
        DYNAMICS.step(resting(), np.array([[0.0, bad]]), SEA, 0.0, 0.01)


def test_a_state_that_is_not_finite_is_refused():
    broken = dataclasses.replace(resting(), rates_B=np.array([[0.0, np.nan, 0.0]]))
    with pytest.raises(ValueError, match="state must be finite"):
        DYNAMICS.step(broken, np.zeros((1, 2)), SEA, 0.0, 0.01)


def test_commands_for_another_number_of_vessels_are_refused():
    with pytest.raises(ValueError, match="one row a vessel"):
        DYNAMICS.step(resting(2), np.zeros((3, 2)), SEA, 0.0, 0.01)


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan])
def test_a_step_without_length_is_refused(dt):
    with pytest.raises(ValueError, match="longer than 0"):
        DYNAMICS.step(resting(), np.zeros((1, 2)), SEA, 0.0, dt)


def test_an_unknown_wind_frame_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError, match="wind_frame"):
        convert({"wind_frame": "moon"}, DynamicsSettings)


def test_wind_from_astern_pushes_ahead_and_wind_from_port_to_starboard():
    # The trim of 0.6 deg turns a little of it out of the horizontal.
    still = force(resting())
    astern = force(resting(), windy(10, from_deg=180)) - still
    port = force(resting(), windy(10, from_deg=270)) - still
    np.testing.assert_allclose(astern, [50, 0, 0, 0, 0, 0], atol=0.01)
    np.testing.assert_allclose(port, [0, 50, 0, 0, 0, 0], atol=0.01)


def test_wind_from_the_quarter_turns_the_vessel_towards_beam_on():
    # From port astern: u = v = 10 / sqrt 2, N = -2 c u v = -33 N m: the bow falls off to port.
    moment = force(resting(), windy(10, from_deg=225))[5] - force(resting())[5]
    assert moment == pytest.approx(-2 * 0.33 * 50.0, rel=1e-3)


def vrx_wind_in_enu(velocity_enu):
    """VRX's formula as it stands, in east-north-up."""
    x, y = velocity_enu
    return 0.5 * x * abs(x), 0.5 * y * abs(y), -2 * 0.33 * x * y


@pytest.mark.parametrize("from_deg", [0, 30, 135, 200, 315])
@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_vrxs_quirk_takes_the_coefficients_along_east_and_north(from_deg, heading):
    vrx = VesselDynamics(centred_with_windage(), as_vrx())
    rest = resting(heading=heading, dynamics=vrx)
    got = force(rest, windy(10, from_deg), vrx) - force(rest, SEA, vrx)
    towards = np.radians(from_deg + 180)
    fx, fy, mz = vrx_wind_in_enu((10 * np.sin(towards), 10 * np.cos(towards)))
    north, east = fy, fx
    ahead = north * np.cos(heading) + east * np.sin(heading)
    starboard = -north * np.sin(heading) + east * np.cos(heading)
    np.testing.assert_allclose(got, [ahead, starboard, 0, 0, 0, -mz], atol=1e-8)


def centred_with_windage():
    return dataclasses.replace(centred_vessel(), windage=WAM_V.windage)

"""The simulated WAM-V does what the paper, closed forms and seamanship tests say.

docs/simulator.md lists the figures. `planar` is the steady balance of surge, sway and yaw written
down by hand, without the code under test.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import fsolve
from tests.reference.sailing import (
    NO_WIND,
    calm,
    centred_vessel,
    euler,
    sail,
    series,
    windy,
)

from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics, as_vrx, join
from twinscrew.hil_sim.vessel.rest import at_rest, equilibrium
from twinscrew.runtime.vessel_description import load_vessel

WAM_V = load_vessel()
DYNAMICS = VesselDynamics(WAM_V)
BODY = join(WAM_V.parts)
ARM = 1.027135  # [m]


def resting(heading=0.0, dynamics=DYNAMICS):
    return at_rest(dynamics, np.zeros((1, 2)), np.array([heading]))


def planar_forces(u, v, r, left, right):
    """Surge, sway and yaw: thrust, drag, still air, and the terms of a turning body."""
    m, x_g = BODY.mass, BODY.centre_B[0]
    X = left + right - (100 + 150 * abs(u)) * u - 0.5 * abs(u) * u + m * (v * r + x_g * r * r)
    Y = -(100 + 100 * abs(v)) * v - 0.5 * abs(v) * v - m * u * r
    N = (left - right) * ARM - (800 + 800 * abs(r)) * r - 0.66 * u * v - m * x_g * u * r
    return np.array([X, Y, N])


def test_full_ahead_reaches_the_papers_speed():
    # Paper, sec. III: about 3.3 m/s.
    end = sail(DYNAMICS, resting(), (1000, 1000), calm(), 40)[-1]
    assert end.velocity_B[0, 0] == pytest.approx(3.3, abs=0.05)


def test_full_astern_reaches_the_papers_speed():
    # Paper, sec. III: about 2.3 m/s.
    end = sail(DYNAMICS, resting(), (-500, -500), calm(), 40)[-1]
    assert end.velocity_B[0, 0] == pytest.approx(-2.3, abs=0.05)


def test_surge_against_quadratic_drag_is_a_tanh():
    # m u' = T - b u^2 from rest: u = u_inf tanh(t / t_0), u_inf = sqrt(T / b), t_0 = m u_inf / T.
    vessel = replace(centred_vessel(), linear_drag=(0.0, *WAM_V.linear_drag[1:]))
    dynamics = VesselDynamics(vessel)
    states = sail(dynamics, resting(dynamics=dynamics), (600, 600), calm(), 8, dt_s=0.001)
    t = 0.001 * np.arange(len(states))
    u_inf = np.sqrt(1200 / 150)
    expected = u_inf * np.tanh(t / (280 * u_inf / 1200))
    np.testing.assert_allclose(series(states, "velocity_B", 0), expected, atol=2e-3)


def test_surge_against_linear_drag_is_an_exponential():
    vessel = replace(centred_vessel(), quadratic_drag=(0.0, *WAM_V.quadratic_drag[1:]))
    dynamics = VesselDynamics(vessel)
    states = sail(dynamics, resting(dynamics=dynamics), (100, 100), calm(), 8, dt_s=0.001)
    t = 0.001 * np.arange(len(states))
    expected = 2.0 * (1 - np.exp(-t * 100 / 280))
    np.testing.assert_allclose(series(states, "velocity_B", 0), expected, atol=2e-3)


def test_turning_on_the_spot_reaches_the_rate_of_its_closed_form():
    # N_r r + N_rr r^2 = (T_left - T_right) arm, arm 1 m.
    dynamics = VesselDynamics(centred_vessel())
    end = sail(dynamics, resting(dynamics=dynamics), (500, -500), calm(), 20)[-1]
    expected = (-800 + np.sqrt(800**2 + 4 * 800 * 1000)) / (2 * 800)
    assert end.rates_B[0, 2] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("thrust", [(1000, 500), (1000, 0), (1000, -500), (500, 250)])
def test_a_turning_circle_settles_to_the_planar_balance(thrust):
    # 1 %: the planar model knows no heel (at most 0.2 deg).
    end = sail(DYNAMICS, resting(), thrust, calm(), 60)[-1]
    u, v, r = fsolve(lambda y: planar_forces(*y, *thrust), [2.0, -0.5, 0.5])
    np.testing.assert_allclose(end.velocity_B[0, :2], [u, v], rtol=0.01)
    assert end.rates_B[0, 2] == pytest.approx(r, rel=0.01)


def test_a_turning_circle_to_port_mirrors_the_one_to_starboard():
    starboard = sail(DYNAMICS, resting(), (1000, 500), calm(), 30)[-1]
    port = sail(DYNAMICS, resting(), (500, 1000), calm(), 30)[-1]
    np.testing.assert_allclose(port.position_N[0], starboard.position_N[0] * [1, -1, 1], atol=1e-6)


def test_a_zigzag_overshoots_as_the_planar_model():
    # 20/20 zig-zag (IMO MSC.137(76)): the thrust difference is reversed at every 20 deg.
    side = {"six": 1.0, "planar": 1.0}

    def thrust(heading, model):
        if heading * side[model] > np.radians(20):
            side[model] = -side[model]
        return 650 + 350 * side[model], 650 - 350 * side[model]

    states = sail(DYNAMICS, resting(), lambda s, _t: thrust(s.heading[0], "six"), calm(), 40)
    six = np.array([state.heading[0] for state in states])[:-1]
    planar = fixed_step_planar(lambda y: thrust(y[3], "planar"), 40)[:, 3]
    for heading in (six, planar):
        assert np.degrees(heading.max()) > 21
    assert np.degrees(six.max()) == pytest.approx(np.degrees(planar.max()), abs=0.5)
    assert np.degrees(six.min()) == pytest.approx(np.degrees(planar.min()), abs=0.5)
    assert crossings(six) == crossings(planar)


def fixed_step_planar(thrust_at, seconds, dt=0.01):
    """The planar model by the midpoint rule, the thrust held over each step."""
    m, x_g, inertia = BODY.mass, BODY.centre_B[0], BODY.inertia_B[2, 2]
    M = np.array([[m, 0, 0], [0, m, m * x_g], [0, m * x_g, inertia]])
    y, rows = np.zeros(4), []
    for _ in range(round(seconds / dt)):
        rows.append(y)
        left, right = thrust_at(y)

        def rate(y, left=left, right=right):
            return np.append(np.linalg.solve(M, planar_forces(*y[:3], left, right)), y[2])

        y = y + dt * rate(y + dt / 2 * rate(y))
    return np.array(rows)


def crossings(heading):
    return int(np.sum(np.diff(np.sign(heading[heading != 0])) != 0))


def test_a_drifting_vessel_lies_beam_on_and_balances_wind_and_drag():
    # 0.5 (10 - v)^2 = 100 v + 100 v^2.
    end = sail(DYNAMICS, resting(heading=0.5), (0, 0), windy(10, from_deg=90), 300)[-1]
    v = fsolve(lambda v: 0.5 * (10 - v) ** 2 - 100 * v - 100 * v * v, 0.3)[0]
    assert abs(np.sin(end.heading[0])) < 1e-3
    assert np.linalg.norm(end.velocity_B[0]) == pytest.approx(v, rel=1e-3)


def one_wave(period_s, towards_deg, gain=0.05):
    """Low waves from one direction, there from the start: the middle component alone matters."""
    waves = WaveSettings(
        period_s=period_s, gain=gain, towards_deg=towards_deg, spread_rad=0.0, ramp_s=0.0
    )
    sea = Sea(SeaSettings(waves=waves, wind=NO_WIND), np.random.default_rng(0))
    sea.wave_table[[0, 2], 0] = 0.0
    return sea


def amplitude(values, frequency):
    """The size of a motion at a frequency, over whole periods, by a Fourier sum."""
    t = 0.01 * np.arange(len(values))
    return 2 * abs(np.mean((values - np.mean(values)) * np.exp(-1j * frequency * t)))


def response(period_s, towards_deg):
    """Amplitudes of surface, heave, roll and pitch in a regular wave, after 60 s to settle."""
    sea = one_wave(period_s, towards_deg)
    states = sail(DYNAMICS, resting(), (0, 0), sea, 60 + 8 * period_s)[6000:-1]
    height, _, k_east, frequency, _ = sea.wave_table[1]
    k = np.hypot(sea.wave_table[1, 1], k_east)
    roll, pitch, _ = np.array([euler(state)[0] for state in states]).T
    motions = [series(states, "position_N", 2), roll, pitch]
    return height, k, [amplitude(motion, frequency) for motion in motions]


def test_a_vessel_heaves_with_long_waves():
    # 10 s: 156 m long, 60 times the keel points' distance. Within 2 %.
    height, _, (heave, _, _) = response(10.0, towards_deg=0.0)
    assert heave == pytest.approx(height, rel=0.02)


def test_a_vessel_rolls_with_the_slope_of_long_beam_waves():
    height, k, (_, roll, pitch) = response(10.0, towards_deg=90.0)
    assert roll == pytest.approx(k * height, rel=0.05)
    assert pitch < 0.1 * roll


def linear_head_sea(k, w):
    """Heave and pitch for a head wave of 1 m, by linear seakeeping of surge, heave and pitch."""
    m, (x_g, _, z_g) = BODY.mass, BODY.centre_B
    down, pitch = equilibrium(DYNAMICS)
    r, x = WAM_V.buoyancy.hull_radius_m, np.array([0.6, -1.4, 0.6, -1.4])
    wet = down - x * pitch
    stiff = 997.7735 * 9.81 * 4.9 / 2 * 2 * np.sqrt(2 * r * wet - wet**2)
    M = np.array([[m, 0, m * z_g], [0, m, -m * x_g], [m * z_g, -m * x_g, BODY.inertia_B[1, 1]]])
    C = np.zeros((3, 3))
    C[1, 1], C[1, 2] = np.sum(stiff), -np.sum(stiff * x)
    C[2, 1], C[2, 2] = C[1, 2], np.sum(stiff * x * x) + z_g * m * 9.81
    height = np.exp(1j * k * x)  # of a wave that meets the bow, at each keel point
    force = np.array([0, -np.sum(stiff * height), np.sum(stiff * x * height)])
    motion = np.linalg.solve(C - w * w * M + 1j * w * np.diag([100, 500, 900]), force)
    return np.abs(motion[1:])


@pytest.mark.parametrize("period_s", [10.0, 5.0, 2.5])
def test_a_vessel_heaves_and_pitches_in_head_waves_as_linear_seakeeping_says(period_s):
    height, k, (heave, roll, pitch) = response(period_s, towards_deg=180.0)
    expected = height * linear_head_sea(k, 2 * np.pi / period_s)
    np.testing.assert_allclose([heave, pitch], expected, rtol=0.005)
    assert roll < 1e-6


def test_short_waves_heave_as_the_linear_oscillator_of_the_hulls():
    # Mass-spring-damper in heave, closed form: c / (c - m w^2 + i d w), keel points in phase.
    dynamics = VesselDynamics(centred_vessel())
    rest = resting(dynamics=dynamics)
    sea = one_wave(1.2, towards_deg=90.0, gain=0.2)
    sea.wave_table[1, 1:3] = 0.0  # the same height everywhere, as a wave without end
    states = sail(dynamics, rest, (0, 0), sea, 40 + 1.2 * 10, dt_s=0.01)[4000:-1]
    height, _, _, w, _ = sea.wave_table[1]
    r, down = WAM_V.buoyancy.hull_radius_m, rest.position_N[0, 2]
    c = 997.7735 * 9.81 * 2 * 4.9 * 2 * np.sqrt(2 * r * down - down**2)
    gain = abs(c / (c - 280.1 * w**2 + 500j * w))
    assert gain > 1.2
    assert amplitude(series(states, "position_N", 2), w) == pytest.approx(gain * height, rel=0.03)


def test_vrxs_step_of_50_ms_gives_the_same_speeds():
    vrx = VesselDynamics(WAM_V, as_vrx())
    for thrust in ((1000, 1000), (-500, -500), (1000, 500)):
        ours = sail(DYNAMICS, resting(), thrust, calm(), 40)[-1]
        theirs = sail(vrx, resting(), thrust, calm(), 40, dt_s=0.05)[-1]
        np.testing.assert_allclose(theirs.velocity_B, ours.velocity_B, atol=0.01)
        np.testing.assert_allclose(theirs.rates_B, ours.rates_B, atol=0.005)

"""Laws of station keeping, on hulls made up at random of which only the least data is known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.hil_sim.identification.hulls import _described, made_up
from twinscrew.hil_sim.odometry import OdometrySettings, measure
from twinscrew.hil_sim.sea.sea import Sea, SeaSettings, WaveSettings, WindSettings
from twinscrew.hil_sim.vessel.dynamics import VesselDynamics
from twinscrew.hil_sim.vessel.rest import at_rest
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.types import Odometry, Station
from twinscrew.runtime.safety.guard import ThrustLimits
from twinscrew.runtime.vessel.station import Keeper, StationSettings
from twinscrew.runtime.vessel_description import VesselDescription, load_vessel

HULLS = st.integers(0, 10_000)
ANGLES = st.floats(-math.pi, math.pi)
METRES = st.floats(-30.0, 30.0)
SPEEDS = st.floats(-2.0, 2.0)


def keeper_of(vessel: VesselDescription) -> Keeper:
    thrusters = vessel.thrusters
    return Keeper(StationSettings(), vessel, ThrustLimits(thrusters.min_n, thrusters.max_n))


def state(time_s, north, east, heading, surge=0.0, sway=0.0, yaw_rate=0.0) -> Odometry:
    return Odometry(
        stamp_ns=round(time_s * 1e9),
        position_N=np.array([north, east, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.array([surge, sway, 0.0]),
        rates_B=np.array([0.0, 0.0, yaw_rate]),
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_hull_of_which_the_least_is_known_finds_its_place_and_stays(seed):
    """The truth differs from what is known by up to 20 % in thrust, by twice in drag and mass."""
    truth, known, _ = made_up(seed)
    hull, believed = _described(truth), _described(known)
    rng = np.random.default_rng(seed)
    drift = 0.12 * hull.top_speed_mps
    way = rng.uniform(-math.pi, math.pi)
    sea = Sea(
        SeaSettings(
            waves=WaveSettings(gain=0.0),
            wind=WindSettings(mean_mps=0.0),
            current_mps=(drift * math.cos(way), drift * math.sin(way)),
        ),
        rng,
    )
    dynamics, keeper = VesselDynamics(hull), keeper_of(believed)
    place = 2.0 * hull.length_m * rng.uniform(-1.0, 1.0, 2)
    body = at_rest(dynamics, place[None], rng.uniform(-math.pi, math.pi, 1))
    station, thrust, off = Station(stamp_ns=0, position_N=np.zeros(2)), np.zeros(2), []
    for k in range(1500):
        odometry = measure(body, 0, k * 100_000_000, OdometrySettings(), rng)
        thrust, _ = keeper.step(odometry, thrust, station)
        off.append(math.hypot(*odometry.position_N[:2]))
        for _ in range(5):
            body = dynamics.step(body, thrust[None], sea, 0.1 * k, 0.02)
    assert max(off[-300:]) < max(0.3, 0.15 * hull.length_m)


@settings(max_examples=examples(60), deadline=None)
@given(HULLS, METRES, METRES, ANGLES, SPEEDS, SPEEDS, st.floats(-1.0, 1.0), st.booleans())
def test_no_thrust_beyond_the_limits_is_asked_for(
    seed, north, east, heading, surge, sway, rate, astern
):
    hull = _described(made_up(seed)[1])
    keeper, thrust = keeper_of(hull), np.zeros(2)
    station = Station(stamp_ns=0, position_N=np.zeros(2), heading=1.0 if astern else None)
    for k in range(4):
        now = state(0.1 * k, north, east, heading + 0.3 * k, surge, sway, rate)
        thrust, _ = keeper.step(now, thrust, station)
        assert np.isfinite(thrust).all()
        low, high = hull.thrusters.min_n, hull.thrusters.max_n
        assert (thrust >= low).all()
        assert (thrust <= high).all()


@settings(max_examples=examples(40), deadline=None)
@given(METRES, METRES, ANGLES, SPEEDS, SPEEDS, st.floats(-1.0, 1.0))
def test_the_mirrored_problem_has_the_mirrored_thrust(north, east, heading, surge, sway, rate):
    # Straight astern is as far round by port as by starboard: a little off it there is one answer.
    east, heading, sway = east + 0.1234, heading + 0.0567, sway + 0.0321
    hull = load_vessel("otter")
    one, other = keeper_of(hull), keeper_of(hull)
    station = Station(stamp_ns=0, position_N=np.zeros(2))
    thrust, mirrored = np.zeros(2), np.zeros(2)
    for k in range(4):
        turned = heading + 0.1 * k * rate
        thrust, _ = one.step(
            state(0.1 * k, north, east, turned, surge, sway, rate), thrust, station
        )
        mirrored, _ = other.step(
            state(0.1 * k, north, -east, -turned, surge, -sway, -rate), mirrored, station
        )
    assert mirrored[::-1] == pytest.approx(thrust, abs=1e-6 * hull.thrusters.max_n)


@settings(max_examples=examples(20), deadline=None)
@given(ANGLES, st.floats(0.1, 0.5))
def test_at_rest_in_its_place_the_thrust_balances_the_drift(way, share):
    """What pushes is learnt from the motion alone: a boat that is held still feels its thrust."""
    hull = load_vessel("wam_v")
    keeper = keeper_of(hull)
    push = share * hull.thrusters.max_n
    bow = way + math.pi  # into it
    station = Station(stamp_ns=0, position_N=np.zeros(2))
    held = np.full(2, push / 2.0)  # it does not move under this thrust: something balances it
    for k in range(400):
        thrust, _ = keeper.step(state(0.1 * k, 0.0, 0.0, bow), held, station)
    assert thrust.sum() == pytest.approx(push, rel=0.01)
    assert thrust[0] == pytest.approx(thrust[1], abs=0.01 * push)


def test_a_heading_that_the_drift_forbids_is_given_up_and_said():
    hull = load_vessel("wam_v")
    keeper = keeper_of(hull)
    station = Station(stamp_ns=0, position_N=np.zeros(2), heading=math.pi / 2)
    said = []
    for k in range(600):  # the drift comes from ahead: from north
        _, events = keeper.step(state(0.1 * k, 0.0, 0.0, 0.0), np.array([100.0, 100.0]), station)
        said += [event.name for event in events]
    assert said == ["station_heading"]


def test_a_heading_into_the_drift_is_held_without_a_word():
    keeper = keeper_of(load_vessel("wam_v"))
    station = Station(stamp_ns=0, position_N=np.zeros(2), heading=0.0)
    for k in range(600):
        _, events = keeper.step(state(0.1 * k, 0.0, 0.0, 0.0), np.array([100.0, 100.0]), station)
        assert events == ()

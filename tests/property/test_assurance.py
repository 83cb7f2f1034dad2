import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.runtime.geometry import quaternion_from_euler, rotation_2d
from twinscrew.runtime.messages.types import Float64, Odometry, Tracks
from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.safety.assurance import Assurance, AssuranceSettings

SCAN_S = 0.1
RADIUS_M = 2.8
VESSEL = VesselModel(
    VesselParameters(
        mass_kg=280.0,
        izz=708.0,
        x_udot=0.0,
        n_rdot=0.0,
        n_r=-800.0,
        y_vv=-100.0,
        n_rr=-800.0,
        width=2 * 1.027,
    )
)
"""The vessel that the assurance assumes, in the equations of the training model."""


def odometry(scan: int, pose: Float64, nu: Float64) -> Odometry:
    return Odometry(
        stamp_ns=round(scan * SCAN_S * 1e9),
        position_N=np.array([pose[0], pose[1], 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, pose[2]),
        velocity_B=np.array([nu[0], nu[1], 0.0]),
        rates_B=np.array([0.0, 0.0, nu[2]]),
    )


def buoys(scan: int, p_N: Float64) -> Tracks:
    return Tracks(
        stamp_ns=round(scan * SCAN_S * 1e9),
        id=np.arange(len(p_N)),
        p_N=p_N,
        v_N=np.zeros_like(p_N),
        radius=np.full(len(p_N), 1.0),
        covariance=np.zeros((len(p_N), 4, 4)),
        age_s=np.zeros(len(p_N)),
    )


class Voyage:
    """A reckless policy among buoys, ten scans a second, in a wind that pushes with a force."""

    def __init__(
        self,
        p_N: Float64,
        rates: list[tuple[float, float]],
        wind_N: tuple[float, float] = (0.0, 0.0),
        **wanted: object,
    ) -> None:
        self.p_N = p_N
        self.wind_N = np.array(wind_N)
        self.assurance = Assurance(AssuranceSettings(**{"enabled": True, **wanted}))
        self.thrusts = [np.zeros(2)]
        self.decided = [np.zeros(2)]
        self.gaps = []
        self._sail(rates)

    def _sail(self, rates: list[tuple[float, float]]) -> None:
        pose, nu, limits = np.zeros(3), np.zeros(3), self.assurance.limits
        for scan in range(5 * len(rates)):
            before = self.thrusts[-1]
            decides = scan % 5 == 0
            change = 0.5 * np.array(rates[scan // 5]) if decides else np.zeros(2)
            command = limits.clip(before + change)
            thrust, _ = self.assurance.step(
                odometry(scan, pose, nu), buoys(scan, self.p_N), before, command, decided=decides
            )
            self.thrusts.append(thrust)
            self.decided.append(command)
            for _ in range(10):
                wind_B = self.wind_N @ rotation_2d(pose[2])
                tau = np.array([*wind_B, 0.0])
                pose, nu = VESSEL.step(pose, nu, thrust, SCAN_S / 10, tau)
            self.gaps.append(np.hypot(*(self.p_N - pose[:2]).T) - RADIUS_M - 1.0)


RATE = st.floats(-1000.0, 1000.0)
RATES = st.lists(st.tuples(RATE, RATE), min_size=10, max_size=40)
RECKLESS = st.builds(lambda left, right, n: [(left, right)] * n, RATE, RATE, st.integers(10, 30))
PLACE = st.tuples(st.floats(6.0, 12.0), st.floats(-np.pi, np.pi)).map(
    lambda polar: (polar[0] * np.cos(polar[1]), polar[0] * np.sin(polar[1]))
)
PLACES = st.lists(PLACE, min_size=1, max_size=3).map(np.array)


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(PLACES, st.one_of(RATES, RECKLESS))
@example(np.array([[5.26549537, -2.87655323]]), [(0.0, 465.0)] * 21)  # creeps up to it
def test_no_policy_can_run_a_vessel_into_a_buoy(p_N, rates):
    assert np.min(Voyage(p_N, rates).gaps) > 0.0


WIND = st.tuples(st.floats(0.0, 60.0), st.floats(-np.pi, np.pi)).map(
    lambda polar: (polar[0] * np.cos(polar[1]), polar[0] * np.sin(polar[1]))
)


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(PLACES, st.one_of(RATES, RECKLESS), WIND)
@example(np.array([[6.0, 0.0]]), [(0.0, 0.0)] * 60, (50.0, 0.0))  # only drifts
@example(np.array([[0.0, 6.0]]), [(0.0, 0.0)] * 60, (0.0, 50.0))  # beam on
def test_nor_can_a_policy_and_the_wind_together(p_N, rates, wind_N):
    assert np.min(Voyage(p_N, rates, wind_N).gaps) > 0.0


@pytest.mark.slow
def test_who_does_not_learn_of_the_wind_drifts_into_the_buoy():
    turning = [(300.0, -200.0)] * 80
    abeam = [np.array([[0.0, distance_m]]) for distance_m in (5.0, 6.0, 8.0)]

    def nearest(**wanted: object) -> float:
        return min(np.min(Voyage(p_N, turning, (0.0, 120.0), **wanted).gaps) for p_N in abeam)

    assert nearest() > 0.1
    assert nearest(disturbance_limit_n=0.0) < 0.0


def test_without_it_the_same_recklessness_ends_on_the_buoy():
    ahead = [(1000.0, 1000.0)] * 20
    p_N = np.array([[12.0, 0.5]])
    assert np.min(Voyage(p_N, ahead, enabled=False).gaps) < 0.0
    assert np.min(Voyage(p_N, ahead).gaps) > 0.0


@pytest.mark.slow
@settings(max_examples=examples(30), deadline=None)
@given(PLACES, RATES)
def test_a_manoeuvre_respects_the_propellers_limits(p_N, rates):
    voyage = Voyage(p_N, rates)
    thrusts, decided = np.array(voyage.thrusts), np.array(voyage.decided)
    overridden = np.any(thrusts != decided, axis=1)
    change = np.abs(np.diff(thrusts, axis=0))
    assert thrusts.min() >= -500.0
    assert thrusts.max() <= 1000.0
    assert np.all(change[overridden[1:]] <= 100.0 + 1e-9)


@pytest.mark.slow
@settings(max_examples=examples(30), deadline=None)
@given(PLACES, RATES)
def test_the_same_inputs_give_the_same_bits(p_N, rates):
    first, again = Voyage(p_N, rates), Voyage(p_N, rates)
    assert np.array(first.thrusts).tobytes() == np.array(again.thrusts).tobytes()


@settings(max_examples=examples(30), deadline=None)
@given(PLACES, RATES, st.floats(-np.pi, np.pi), st.floats(-500.0, 500.0))
def test_the_verdict_does_not_care_where_north_is(p_N, rates, angle, away):
    """The same scene turned and shifted gives the same thrust, to rounding."""
    R = rotation_2d(angle)
    here, there = (
        Assurance(AssuranceSettings(enabled=True)),
        Assurance(AssuranceSettings(enabled=True)),
    )
    nu = np.array([2.5, 0.2, 0.1])
    before = np.array([900.0, 800.0])
    command = here.limits.clip(before + 0.5 * np.array(rates[0]))
    offset = np.array([away, -away])
    turned = odometry(0, np.array([offset[0], offset[1], angle]), nu)
    first, _ = here.step(odometry(0, np.zeros(3), nu), buoys(0, p_N), before, command, decided=True)
    second, _ = there.step(turned, buoys(0, offset + p_N @ R.T), before, command, decided=True)
    assert np.allclose(first, second, atol=1e-6)

import numpy as np
import pytest

from twinscrew.runtime.policy.vessel_model import VesselModel, VesselParameters
from twinscrew.runtime.safety.prediction import (
    STILL,
    AssuranceVessel,
    DisturbanceObserver,
    Foresight,
    Motion,
)

VESSEL = AssuranceVessel(
    inertia=(380.0, 400.0, 1430.0),
    linear_drag=(100.0, 100.0, 980.0),
    quadratic_drag=(150.0, 150.0, 950.0),
    lever_m=1.25,
)
SCAN_NS = 100_000_000


def observer(time_constant_s: float = 3.0, limit_n: float = 300.0) -> DisturbanceObserver:
    foresight = Foresight(
        VESSEL, steps=1, dt=0.1, slew_nps=1000.0, margin_m=0.5, approach_per_s=1.0
    )
    return DisturbanceObserver(
        foresight.acceleration,
        VESSEL.inertia[:2],
        time_constant_s=time_constant_s,
        limit_n=limit_n,
    )


def learnt(
    observing: DisturbanceObserver,
    wind_N: tuple[float, float] = (0.0, 0.0),
    thrust: tuple[float, float] = (0.0, 0.0),
    scans: int = 200,
) -> tuple[np.ndarray, float]:
    """Sail the training model in a wind; give what was learnt, in frame N, and the heading."""
    model, pose, nu = VesselModel(VesselParameters()), np.zeros(3), np.zeros(3)
    push = STILL
    for scan in range(scans):
        push = observing.step(scan * SCAN_NS, Motion(*nu.tolist()), pose[2], thrust)
        for _ in range(20):
            c, s = np.cos(pose[2]), np.sin(pose[2])
            wind_B = c * wind_N[0] + s * wind_N[1], c * wind_N[1] - s * wind_N[0]
            tau = np.array([*wind_B, 0.0])
            heading = pose[2]
            pose, nu = model.step(pose, nu, np.array(thrust), 0.005, tau)
    c, s = np.cos(heading), np.sin(heading)
    return np.array([c * push[0] - s * push[1], s * push[0] + c * push[1]]), heading


@pytest.mark.parametrize(
    ("thrust", "within_n"), [((0.0, 0.0), 0.5), ((600.0, 600.0), 0.5), ((800.0, -200.0), 4.0)]
)
def test_a_steady_wind_is_learnt_whatever_the_vessel_does_and_stays_as_it_turns(thrust, within_n):
    force_N, _ = learnt(observer(), (40.0, -30.0), thrust)
    assert force_N == pytest.approx([40.0, -30.0], abs=within_n)


def test_in_still_air_nothing_is_learnt_of_hard_manoeuvres():
    force_N, heading = learnt(observer(), thrust=(1000.0, -500.0))
    assert abs(heading) > 1.0
    assert np.abs(force_N).max() < 1.0


def test_after_a_time_constant_63_percent_are_known():
    force_N, _ = learnt(observer(time_constant_s=2.0), (50.0, 0.0), scans=21)
    assert force_N[0] == pytest.approx(50.0 * (1.0 - np.exp(-1.0)), rel=0.02)


def test_it_is_never_taken_for_more_than_the_limit_and_keeps_its_direction():
    force_N, _ = learnt(observer(limit_n=25.0), (40.0, -30.0))
    assert force_N == pytest.approx([20.0, -15.0], abs=0.5)


def test_with_no_limit_left_nothing_is_learnt():
    force_N, _ = learnt(observer(limit_n=0.0), (40.0, -30.0))
    assert force_N.tolist() == [0.0, 0.0]


def test_nothing_is_learnt_across_a_pause_a_gap_or_a_step_back_in_time():
    still, thrown = Motion(0.0, 0.0, 0.0), Motion(2.0, 0.0, 0.0)
    for elapsed_ns, pauses in ((SCAN_NS, True), (600_000_000, False), (-SCAN_NS, False)):
        observing = observer()
        observing.step(0, still, 0.0, (0.0, 0.0))
        if pauses:
            observing.pause()
        assert observing.step(elapsed_ns, thrown, 0.0, (0.0, 0.0)) == STILL
    observing = observer()
    observing.step(0, still, 0.0, (0.0, 0.0))
    assert observing.step(SCAN_NS, thrown, 0.0, (0.0, 0.0))[0] > 100.0


def test_a_pause_does_not_forget_the_wind():
    observing = observer()
    learnt(observing, (50.0, 0.0))
    observing.pause()
    north, _ = observing.step(10**12, Motion(0.0, 0.0, 0.0), 0.0, (0.0, 0.0))
    assert north == pytest.approx(50.0, abs=1.5)


def test_a_motion_that_is_no_number_spoils_nothing_that_was_learnt():
    observing = observer()
    learnt(observing, (50.0, 0.0))
    for k, surge in enumerate((0.0, float("nan"), float("inf"), 0.0), start=10_000):
        north, _ = observing.step(k * SCAN_NS, Motion(surge, 0.0, 0.0), 0.0, (0.0, 0.0))
        assert north == pytest.approx(50.0, abs=1.5)

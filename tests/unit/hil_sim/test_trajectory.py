import numpy as np
import pytest

from twinscrew.hil_sim.trajectory import TrajectoryLog


def add(log: TrajectoryLog, time_s: float, thrust: float = 0.0, vessels: int = 2) -> None:
    pose = np.column_stack([np.full(vessels, time_s), np.arange(vessels), np.zeros(vessels)])
    log.add(time_s, pose, np.full((vessels, 2), 3.0), np.full((vessels, 2), thrust))


def test_it_keeps_a_row_a_period_and_not_more() -> None:
    log = TrajectoryLog(every_s=0.1)
    for k in range(101):
        add(log, k * 0.05)
    np.testing.assert_allclose(log.times, np.arange(0.0, 5.01, 0.1))
    assert log.rows.shape == (51, 2, 7)


def test_a_row_holds_pose_velocity_and_thrust() -> None:
    log = TrajectoryLog()
    add(log, 2.0, thrust=-7.0)
    assert log.rows[0].tolist() == [[2, 0, 0, 3, 3, -7, -7], [2, 1, 0, 3, 3, -7, -7]]


def test_energy_is_the_integral_of_both_propellers_thrust_whatever_its_sign() -> None:
    log = TrajectoryLog(every_s=0.5)
    for k in range(5):
        add(log, 0.5 * k, thrust=100.0 * (-1) ** k)
    assert log.energy_ns() == pytest.approx([400.0, 400.0])  # 2 s at 2 x 100 N


def test_a_moment_has_no_energy() -> None:
    log = TrajectoryLog()
    assert log.energy_ns().shape == (0,)
    add(log, 0.0, thrust=100.0)
    assert log.energy_ns().tolist() == [0.0, 0.0]

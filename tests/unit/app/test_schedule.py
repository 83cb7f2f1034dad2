import numpy as np

from twinscrew.runtime.app.schedule import DecisionSchedule

MS = 1_000_000


def due_times(stamps_ms: list[float]) -> list[float]:
    schedule = DecisionSchedule(0.5)
    return [t for t in stamps_ms if schedule.is_due(round(t * MS))]


def test_a_decision_is_due_at_once_and_then_every_period() -> None:
    assert due_times([100.0 * k for k in range(12)]) == [0, 500, 1000]


def test_jittering_stamps_do_not_drift() -> None:
    rng = np.random.default_rng(0)
    stamps = [100.0 * k + float(rng.uniform(-20, 20)) for k in range(1, 600)]
    due = due_times(stamps)
    assert len(due) == 120
    np.testing.assert_allclose(np.diff(due), 500, atol=80)


def test_a_slow_sensor_decides_on_every_scan() -> None:
    assert due_times([0, 700, 1400, 2100]) == [0, 700, 1400, 2100]


def test_after_a_gap_the_grid_starts_anew() -> None:
    assert due_times([0, 100, 3070, 3170, 3570]) == [0, 3070, 3570]


def test_a_restart_makes_the_next_stamp_due() -> None:
    schedule = DecisionSchedule(0.5)
    assert schedule.is_due(0)
    assert not schedule.is_due(100 * MS)
    schedule.restart()
    assert schedule.is_due(200 * MS)
    assert not schedule.is_due(300 * MS)

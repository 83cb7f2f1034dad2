import math

import numpy as np
import pytest

from twinscrew.runtime.safety.guard import Guard, ThrustLimits


@pytest.mark.parametrize("thrust", [(0, 0), (-500, 1000), (1000, -500), (12.5, -3)])
def test_what_the_propellers_can_do_passes(thrust: tuple[float, float]) -> None:
    passed, event = Guard().check(np.array(thrust, dtype=float), 5)
    assert passed.tolist() == list(thrust)
    assert event is None


@pytest.mark.parametrize(
    "thrust",
    [(math.nan, 0), (0, math.inf), (-math.inf, 0), (1001, 0), (0, -501), (1e300, 0)],
)
def test_anything_else_becomes_zero_and_an_event(thrust: tuple[float, float]) -> None:
    passed, event = Guard().check(np.array(thrust, dtype=float), 5)
    assert passed.tolist() == [0, 0]
    assert event is not None
    assert event.name == "guard_tripped"
    assert event.stamp_ns == 5
    assert "[-500, 1000] N" in event.detail


def test_a_thrust_of_another_shape_becomes_zero() -> None:
    passed, event = Guard().check(np.zeros(3), 0)
    assert passed.shape == (2,)
    assert event is not None


def test_neutral_thrust_cannot_be_changed_by_whoever_gets_it() -> None:
    passed, _ = Guard().check(np.array([math.nan, 0]), 0)
    with pytest.raises(ValueError, match="read-only"):
        passed[0] = 1.0


def test_limits_are_the_vessels_own() -> None:
    _, event = Guard(ThrustLimits(min_n=-10, max_n=10)).check(np.array([11.0, 0]), 0)
    assert event is not None

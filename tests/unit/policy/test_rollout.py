"""The 25 actions and what the vessel would do under them."""

import math

import numpy as np
import pytest

from twinscrew.runtime.policy.vessel_model import VesselModel, action_set, alignment, rollout

REST = np.zeros(7)


def simulate(actions, ego=REST, **kwargs):
    arguments = {"steps": 5, "step_s": 0.5, "dt": 0.05, **kwargs}
    return rollout(VesselModel(), ego, np.array(actions, dtype=float), **arguments)


def test_there_are_25_different_actions_and_the_first_is_none():
    actions = action_set()
    assert len({tuple(row) for row in actions.tolist()}) == 25
    assert actions[0].tolist() == [0.0, 0.0]


def test_gentler_actions_come_first():
    assert (np.diff(np.abs(action_set()).sum(axis=1)) >= 0).all()


def test_each_action_is_simulated_as_if_it_were_alone():
    together = simulate(action_set())
    alone = simulate(action_set()[7:8])
    assert np.array_equal(together.pose[:, 7], alone.pose[:, 0])
    assert np.array_equal(together.nu[:, 7], alone.nu[:, 0])


def test_thrust_ramps_and_stops_at_its_limits():
    thrust = simulate([[1000.0, -1000.0]]).thrust[:, 0]
    assert thrust[:, 0].tolist() == [500, 1000, 1000, 1000, 1000]
    assert thrust[:, 1].tolist() == [-500, -500, -500, -500, -500]


def test_more_thrust_to_port_turns_to_starboard():
    assert simulate([[500.0, 0.0]]).pose[-1, 0, 2] > 0.1


def test_mirrored_actions_give_mirrored_paths():
    both = simulate([[500.0, -500.0], [-500.0, 500.0]])
    assert both.pose[:, 0, 1:] == pytest.approx(-both.pose[:, 1, 1:])
    assert both.pose[:, 0, 0] == pytest.approx(both.pose[:, 1, 0])


def test_half_the_time_step_gives_half_the_error():
    fine = simulate(action_set(), dt=0.001).pose
    coarse, half = (np.abs(simulate(action_set(), dt=dt).pose - fine).max() for dt in (0.1, 0.05))
    assert 1.7 < coarse / half < 2.4


def test_velocities_are_in_the_axes_of_now():
    ego = np.array([0, 0, 2.0, 0, 1.0, 0, 0])
    after = simulate([[0.0, 0.0]], ego=ego, steps=1)
    heading, surge, sway = after.pose[0, 0, 2], *after.nu[0, 0, :2]
    turned = [
        surge * math.cos(heading) - sway * math.sin(heading),
        surge * math.sin(heading) + sway * math.cos(heading),
    ]
    assert after.velocity[0, 0] == pytest.approx(turned)


@pytest.mark.parametrize(
    ("heading", "velocity", "direction", "expected"),
    [
        (0.0, [2.0, 0.0], [5.0, 0.0], (0.0, 2.0)),
        (0.0, [2.0, 0.0], [0.0, 3.0], (math.pi / 2, 0.0)),
        (3.0, [0.0, 1.0], [-1.0, -0.1], (2 * math.pi - 3.0 - 3.0419, -0.0995)),
        (0.5, [1.0, 0.0], [0.0, 0.0], (0.5, 1.0)),
    ],
)
def test_alignment_is_the_angle_off_a_direction_and_the_speed_along_it(
    heading, velocity, direction, expected
):
    angle, speed = alignment(np.array(heading), np.array(velocity), np.array(direction))
    assert (float(angle), float(speed)) == pytest.approx(expected, abs=1e-3)

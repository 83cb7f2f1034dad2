"""What is on the water: E episodes of V vessels and M buoys.

Components come first, then episodes, then vessels, so that the physics works on long rows. Places
in the plane are complex as well, north + i east.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.types import Float64
from twinscrew.training.scenarios import Scenarios

Mask = NDArray[np.bool_]


class State:
    """Arrays that the environment changes in place."""

    def __init__(self, episodes: int, vessels: int, buoys: int) -> None:
        self.shape = shape = (episodes, vessels)
        self.north_east = np.zeros((2, *shape))
        """[m] (2, E, V)"""
        self.position = np.zeros(shape, complex)
        """[m] (E, V) The same, north + i east."""
        self.heading = np.zeros(shape)
        """[rad] (E, V)"""
        self.nu = np.zeros((3, *shape))
        """[m/s, m/s, rad/s] (3, E, V) Surge, sway, yaw rate."""
        self.thrust = np.zeros((2, *shape))
        """[N] (2, E, V) Left, right; as commanded."""
        self.goal = np.zeros(shape, complex)
        """[m] (E, V)"""
        self.active = np.zeros(shape, bool)
        """(E, V) Who is under way."""
        self.parked = np.zeros(shape, bool)
        """(E, V) Who arrived and lies at its goal."""
        self.buoy = np.zeros((episodes, buoys), complex)
        """[m] (E, M)"""
        self.buoy_there = np.zeros((episodes, buoys), bool)
        """(E, M)"""
        self.decisions = np.zeros(episodes, np.int64)
        """[-] (E,) Since the episode began."""

    @property
    def there(self) -> Mask:
        """(E, V) Which vessels can be seen and touched."""
        there: Mask = self.active | self.parked
        return there

    @property
    def to_goal(self) -> Float64:
        """[m] (E, V) The distance to the goal."""
        distance: Float64 = np.abs(self.goal - self.position)
        return distance

    def begin(self, slots: NDArray[np.intp], scenario: Scenarios) -> None:
        """Put new episodes in some slots, at rest."""
        self.position[slots] = scenario.start
        self.north_east[0, slots] = scenario.start.real
        self.north_east[1, slots] = scenario.start.imag
        self.heading[slots] = scenario.heading
        self.nu[:, slots] = 0.0
        self.thrust[:, slots] = 0.0
        self.goal[slots] = scenario.goal
        self.active[slots] = scenario.vessel
        self.parked[slots] = False
        self.buoy[slots] = scenario.buoy
        self.buoy_there[slots] = scenario.buoy_there
        self.decisions[slots] = 0

    def halt_others(self) -> None:
        """Stop who is not under way."""
        self.nu *= self.active
        self.thrust *= self.active

"""Where every vessel was during a run: what the figure and the summary are made of."""

from __future__ import annotations

import numpy as np

from twinscrew.runtime.messages.types import Float64


class TrajectoryLog:
    """Collects poses at a steady rate; bounded by the run's time limit, some kB a second."""

    def __init__(self, every_s: float = 0.1) -> None:
        self._every_s = every_s
        self._next_s = 0.0
        self._times: list[float] = []
        self._rows: list[Float64] = []
        self._traffic: list[Float64] = []

    def due(self, time_s: float) -> bool:
        """Tell whether it is time for the next row."""
        return time_s >= self._next_s - 1e-9

    def add(
        self,
        time_s: float,
        pose_N: Float64,
        velocity_N: Float64,
        thrust: Float64,
        traffic_N: Float64 | None = None,
    ) -> None:
        """Take in the present state, if it is time to.

        Parameters
        ----------
        time_s
            [s] Simulated time.
        pose_N : (V, 3) float64
            North, east [m], heading [rad].
        velocity_N : (V, 2) float64
            North, east [m/s].
        thrust : (V, 2) float64
            Left, right [N].
        traffic_N : (S, 3) float64, optional
            North, east [m], heading [rad] of scripted ships.
        """
        if not self.due(time_s):
            return
        self._next_s = time_s + self._every_s
        self._times.append(time_s)
        self._rows.append(np.hstack([pose_N, velocity_N, thrust]))
        self._traffic.append(np.empty((0, 3)) if traffic_N is None else traffic_N)

    @property
    def times(self) -> Float64:
        """[s] (T,)."""
        return np.array(self._times)

    @property
    def rows(self) -> Float64:
        """(T, V, 7): north, east, heading, north and east velocity, left and right thrust."""
        return np.array(self._rows)

    @property
    def traffic(self) -> Float64:
        """(T, S, 3): north, east [m], heading [rad] of scripted ships."""
        return np.array(self._traffic).reshape(len(self._traffic), -1, 3)

    def energy_ns(self) -> Float64:
        """[N s] (V,) Integral of |T| dt over both propellers."""
        if len(self._times) < 2:
            return np.zeros(self._rows[0].shape[0] if self._rows else 0)
        total = np.abs(self.rows[:, :, 5:7]).sum(axis=2)
        energy: Float64 = np.trapezoid(total, self.times, axis=0)
        return energy

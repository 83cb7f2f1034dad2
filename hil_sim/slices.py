"""Echoes of a scan, or of a slice of it: some columns, all fired at one moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twinscrew.hil_sim._native import Caster
from twinscrew.hil_sim.bodies import Bodies
from twinscrew.hil_sim.shapes import Shape
from twinscrew.runtime.messages.types import Float64
from twinscrew.runtime.perception.sensor import Sensor

SLICES = 32
"""[-] Of a scan that takes time: 3 ms each at 10 Hz, in which 1 rad/s turns 3 mrad."""

Echoes = tuple[NDArray[np.int32], Float64, NDArray[np.int32]]
"""Beam numbers in the scan, ascending; distances [m]; body numbers."""


class Slice:
    """Columns of a sensor that are cast from one pose. It keeps a workspace."""

    def __init__(
        self, sensor: Sensor, shapes: Sequence[Shape], own_shape: int, columns: NDArray[np.int64]
    ) -> None:
        """Take neighbouring columns, (n,), in the order they fire."""
        self._position_B, self._R_BS = sensor.mount_position_B, sensor.R_BS
        self._caster = Caster(
            sensor.elevations, sensor.azimuths[columns], sensor.range_min_m, sensor.range_max_m
        )
        for shape in shapes:
            number = self._caster.add_shape(
                shape.kinds, shape.centres, shape.rotations, shape.halves
            )
            for down_m, ring in shape.plates:
                self._caster.add_plate(number, down_m, ring)
        self._caster.mount(own_shape, self._position_B, self._R_BS)
        rows = np.arange(len(sensor.elevations))[:, None] * len(sensor.azimuths)
        self._numbers = (rows + columns).astype(np.int32).ravel()
        self._beam, self._body = np.empty((2, self._numbers.size), dtype=np.int32)
        self._distance = np.empty(self._numbers.size)
        time_s = sensor.time_offsets[columns].mean() - sensor.time_offsets[-1]
        self.time_s = float(time_s) if sensor.scan_duration_s else 0.0
        """[s] When it is fired, after the scan's end: negative."""

    def cast(self, bodies: Bodies, own: int) -> Echoes:
        """Give the echoes, where body `own` carries the sensor."""
        R_NB = bodies.R_NB[own]
        count = self._caster.cast(
            bodies.position_N[own] + R_NB @ self._position_B,
            R_NB @ self._R_BS,
            bodies.shape,
            bodies.position_N,
            bodies.R_NB,
            bodies.water_z,
            own,
            self._beam,
            self._distance,
            self._body,
        )
        return self._numbers[self._beam[:count]], self._distance[:count], self._body[:count]


def slices(sensor: Sensor, shapes: Sequence[Shape], own_shape: int) -> list[Slice]:
    """Cut a sensor's scan into slices: one, if it takes no time."""
    parts = SLICES if sensor.scan_duration_s > 0 else 1
    columns = np.array_split(np.arange(len(sensor.azimuths)), parts)
    return [Slice(sensor, shapes, own_shape, part) for part in columns]


def merged(parts: Sequence[Echoes]) -> Echoes:
    """Put echoes together, in order of beam number."""
    beam, distance, body = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(beam, kind="stable")
    return beam[order], distance[order], body[order]

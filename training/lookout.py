"""What the vessels see, decision by decision: perception, its noise, what else goes wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from twinscrew.training.environment_settings import EnvironmentSettings
from twinscrew.training.imperfections import Imperfections
from twinscrew.training.perception import Observations, Things, see_ego, see_objects
from twinscrew.training.perception_noise import NoiseBank
from twinscrew.training.streams import Stream, slot_stream
from twinscrew.training.vessel_state import State


class Lookout:
    """Observes a state with the noise of each slot's own streams.

    Parameters
    ----------
    settings
        The environment.
    slots
        E pairs of a seed and a slot's number.
    """

    def __init__(self, settings: EnvironmentSettings, slots: Sequence[tuple[int, int]]) -> None:
        self._settings = settings
        self._radius = settings.radius
        vessels, buoys = settings.shape
        pairs = (vessels, vessels + buoys)
        self.noise = NoiseBank(settings.noise, _streams(slots, Stream.PERCEPTION), pairs)
        self._imperfections = None
        if settings.imperfections.used:
            streams = _streams(slots, Stream.IMPERFECTION)
            self._imperfections = Imperfections(
                settings.imperfections, streams, pairs, settings.period_s
            )

    def begin(self, slots: NDArray[np.intp]) -> None:
        """Forget what was believed in some slots: new episodes begin."""
        if self._imperfections is not None:
            self._imperfections.forget(slots)

    def observe(self, state: State) -> Observations:
        """See what is around, as things are now."""
        s = self._settings
        heading = np.exp(1j * state.heading)
        ego = see_ego(state.position, heading, state.goal, state.nu, state.thrust)
        things, noise = self._things(state, heading), self.noise.next()
        objects, mask = see_objects(
            heading, things, noise, s.range_m, s.observed_objects, self._imperfections
        )
        return Observations(ego, objects, mask)

    def _things(self, state: State, heading: NDArray[np.complex128]) -> Things:
        """Give all vessels and buoys; a velocity is the one that a tracker follows."""
        episodes, vessels = state.shape
        velocity = np.zeros((episodes, len(self._radius)), complex)
        velocity[:, :vessels] = (state.nu[0] + 1j * state.nu[1]) * heading * state.active
        if self._imperfections is not None:
            velocity = self._imperfections.lagged(velocity)
        return Things(
            position=np.concatenate([state.position, state.buoy], axis=1),
            velocity=velocity,
            radius=self._radius,
            there=np.concatenate([state.there, state.buoy_there], axis=1),
        )


def _streams(slots: Sequence[tuple[int, int]], stream: Stream) -> list[Generator]:
    """Give every slot's generator for one purpose."""
    return [slot_stream(seed, slot, stream) for seed, slot in slots]

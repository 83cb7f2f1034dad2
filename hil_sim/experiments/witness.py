"""What an experiment must remember: what a vessel touched, how often the assurance stepped in."""

from __future__ import annotations

from typing import Any, Literal

from twinscrew.hil_sim.world import World
from twinscrew.runtime.messages.types import Float64, HealthEvent
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.events import ASSURANCE_INTERVENED

Touched = Literal["vessel", "buoy", "quay"]


class WitnessWorld(World):
    """A world, and the first thing that each vessel hit."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """See `World`."""
        self.touched: dict[int, Touched] = {}
        super().__init__(*args, **options)

    def remove(self, vessel: int) -> None:
        """Take a vessel off the map; before that, note what overlaps it most."""
        if self.gaps[vessel].min() <= 0.0:
            self.touched[vessel] = self._kind(int(self.gaps[vessel].argmin()))
        super().remove(vessel)

    def _kind(self, column: int) -> Touched:
        """Say what a column of the gaps is: vessels come first, then buoys, then quays."""
        if column < self.scenario.vessels:
            return "vessel"
        return "buoy" if column < self.scenario.vessels + len(self.scenario.buoys) else "quay"


class WitnessAssurance(Assurance):
    """An assurance, and how often it has taken the propellers from the policy."""

    interventions = 0
    """[-] Manoeuvres begun, or taking over from another."""

    def step(self, *args: Any, **options: Any) -> tuple[Float64, tuple[HealthEvent, ...]]:
        """See `Assurance.step`."""
        thrust, events = super().step(*args, **options)
        self.interventions += sum(event.name == ASSURANCE_INTERVENED.name for event in events)
        return thrust, events

"""Sets of episodes: how many vessels and buoys, and what the paper published for them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
from msgspec import Meta

from twinscrew.hil_sim.random_scenario import Buoys, Vessels
from twinscrew.hil_sim.scenario import Scenario, load_scenario
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import Settings, load, shipped

Name = Annotated[str, Meta(min_length=1)]


class SetSettings(Settings, frozen=True, kw_only=True):
    """Episodes of one kind."""

    name: Name
    """What tables call it."""
    scenario: str = "random"
    """A name in config/scenarios, or a file."""
    vessels: Vessels | None = None
    """[-] None: the scenario says it."""
    buoys: Buoys | None = None
    """[-] None: the scenario says it."""

    def draw(self, seed: int) -> Scenario:
        """Give an episode's beginning; a `ConfigError` if there can be none."""
        return load_scenario(self.scenario, self.vessels, self.buoys, seed)


class SetsFile(Settings, frozen=True, kw_only=True):
    """A file of sets."""

    finite: ClassVar[bool] = False
    set: Annotated[tuple[SetSettings, ...], Meta(min_length=1)]
    published_travel_time_s: dict[str, tuple[float, ...]] = msgspec.field(default_factory=dict)
    """[s] By method, one a set, to compare with; nan where there is none."""

    def __post_init__(self) -> None:
        """Refuse sets that could be taken for each other, and rows of a wrong length."""
        names = [one.name for one in self.set]
        if len(set(names)) < len(names):
            raise ValueError(f"two sets have the same name: {names}")
        for method, row in self.published_travel_time_s.items():
            if len(row) != len(names):
                raise ValueError(f"{method}: {len(row)} travel times for {len(names)} sets")


def load_sets(name: str | Path) -> SetsFile:
    """Read sets: `paper`, or a file.

    Raises
    ------
    ConfigError
        No such file, or one of its sets cannot be sailed.
    """
    path = shipped("experiments", name)
    sets = load(path, SetsFile)
    for one in sets.set:
        try:
            one.draw(seed=0)
        except ConfigError as error:
            raise ConfigError(f"set {one.name!r}: {error}", file=path) from error
    return sets

"""The one table of sensors beside the LiDAR: a new one is a file, its settings, and a line here.

A line names the source, the topic that its messages come by (`messages.topics`), its settings in
the configuration's table [senses.NAME], what makes a `Sense` of them, and what the tracker must
know of it ([tracking.sources.NAME] overrides that).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import msgspec

from twinscrew.runtime.senses import ais, radar, ttm
from twinscrew.runtime.senses.nmea import NmeaSettings
from twinscrew.runtime.senses.sense import Sense
from twinscrew.runtime.settings import Settings
from twinscrew.runtime.tracking.detections import SourceSettings


@dataclass(frozen=True, slots=True)
class Kind:
    """One line of the table."""

    topic: str
    settings: type[Settings]
    make: Callable[[Any], Sense]
    source: SourceSettings


SENSES: Final[Mapping[str, Kind]] = MappingProxyType(
    {
        "ais": Kind("nmea", ais.AisSettings, ais.Ais, ais.SOURCE),
        "radar": Kind("radar", radar.RadarSettings, radar.Radar, radar.SOURCE),
        "ttm": Kind("nmea", ttm.TtmSettings, ttm.Ttm, ttm.SOURCE),
    }
)
"""Every kind of sensor, by the name of its source."""


if TYPE_CHECKING:

    class SensesSettings(Settings, frozen=True, kw_only=True):
        """The sensors beside the LiDAR; one without a table is not there."""

        nmea: NmeaSettings = NmeaSettings()
        ais: ais.AisSettings | None = None
        radar: radar.RadarSettings | None = None
        ttm: ttm.TtmSettings | None = None

else:
    SensesSettings = msgspec.defstruct(
        "SensesSettings",
        [
            ("nmea", NmeaSettings, NmeaSettings()),
            *((name, kind.settings | None, None) for name, kind in SENSES.items()),
        ],
        bases=(Settings,),
        frozen=True,
        kw_only=True,
        forbid_unknown_fields=True,
        module=__name__,
    )


def fitted(settings: SensesSettings) -> dict[str, Settings]:
    """Give the settings of each sensor that is there, by name."""
    found = {name: getattr(settings, name) for name in SENSES}
    return {name: each for name, each in found.items() if each is not None}


def topics_of(settings: SensesSettings) -> tuple[str, ...]:
    """Give the topics that the sensors listen to, each once, in the order of the table."""
    return tuple(dict.fromkeys(SENSES[name].topic for name in fitted(settings)))


def sources_of(
    settings: SensesSettings, given: Mapping[str, SourceSettings]
) -> dict[str, SourceSettings]:
    """Give what the tracker must know of each source; what is given wins."""
    return {name: SENSES[name].source for name in fitted(settings)} | dict(given)


def make_senses(settings: SensesSettings) -> dict[str, tuple[Sense, ...]]:
    """Make every sensor that is there, by topic."""
    made: dict[str, tuple[Sense, ...]] = {}
    for name, each in fitted(settings).items():
        kind = SENSES[name]
        made[kind.topic] = (*made.get(kind.topic, ()), kind.make(each))
    return made

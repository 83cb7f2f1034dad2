"""The one table of sensors beside the LiDAR: a new one is a file, its settings, and a line here.

A line names the source and the settings of its table [senses.NAME]. These say by which topic its
messages come (`messages.topics`), what makes a `Sense` of them, and what the tracker must know of
the source; [tracking.sources.NAME] overrides that.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from twinscrew.runtime.senses.ais import AisSettings
from twinscrew.runtime.senses.nmea import NmeaSettings
from twinscrew.runtime.senses.radar import RadarSettings
from twinscrew.runtime.senses.sense import Sense, SenseSettings
from twinscrew.runtime.senses.ttm import TtmSettings
from twinscrew.runtime.settings import Settings
from twinscrew.runtime.tracking.detections import SourceSettings


class SensesSettings(Settings, frozen=True, kw_only=True):
    """The sensors beside the LiDAR. One is there if its table is, which may be empty."""

    nmea: NmeaSettings = NmeaSettings()
    ais: AisSettings | None = None
    radar: RadarSettings | None = None
    ttm: TtmSettings | None = None


def fitted(settings: SensesSettings) -> dict[str, SenseSettings]:
    """Give the settings of each sensor that is there, by name, in the order of the table."""
    values = {f.name: getattr(settings, f.name) for f in msgspec.structs.fields(settings)}
    return {name: value for name, value in values.items() if isinstance(value, SenseSettings)}


def sense_topics(settings: SensesSettings) -> tuple[str, ...]:
    """Give the topics that the sensors listen to, each once."""
    return tuple(dict.fromkeys(each.topic for each in fitted(settings).values()))


def sources_of(
    settings: SensesSettings, given: Mapping[str, SourceSettings]
) -> dict[str, SourceSettings]:
    """Give what the tracker must know of each source; what is given wins."""
    return {name: each.source for name, each in fitted(settings).items()} | dict(given)


def make_senses(settings: SensesSettings) -> dict[str, tuple[Sense, ...]]:
    """Make every sensor that is there, by topic."""
    made: dict[str, tuple[Sense, ...]] = {}
    for name, each in fitted(settings).items():
        made[each.topic] = (*made.get(each.topic, ()), each.make(name))
    return made

"""When a track is born, how long it coasts, when it is dropped."""

from __future__ import annotations

import math
from collections.abc import Sequence

from twinscrew.runtime.settings import Count, Fraction, NonNegative, Settings
from twinscrew.runtime.tracking.track import Track


class LifeSettings(Settings, frozen=True, kw_only=True):
    """The life of a track."""

    birth_hits: Count = 3
    """[-] A track is reported once seen in this many"""
    birth_scans: Count = 5
    """[-] of its first this many scans; if it is not, it is dropped."""
    coast_s: NonNegative = 2.0
    """[s] A track unseen for longer is dropped; so is one unseen for longer than it was known."""
    join_share: Fraction = 0.85
    """[-] What is this near a track's centre, as a share of its radius, is a piece of it."""


def is_born(track: Track, settings: LifeSettings) -> bool:
    """Tell whether a track that is not reported yet should be.

    A piece of something long that stands is at once: that has been seen for long enough.
    """
    return not track.confirmed and (track.hits >= settings.birth_hits or track.stands)


def lives(track: Track, settings: LifeSettings) -> bool:
    """Tell whether a track should be kept, by how often and how lately it was seen."""
    if not track.confirmed:
        missed = track.scans - track.hits
        return missed <= settings.birth_scans - settings.birth_hits
    seen_for = track.known_s - track.age_s
    return track.age_s <= min(settings.coast_s, seen_for)


def is_absorbed(track: Track, tracks: Sequence[Track], settings: LifeSettings) -> bool:
    """Tell whether an unseen track lies within the circle of a seen one: it was its piece."""
    if track.age_s == 0.0:
        return False
    north, east = track.x[:2]
    return any(
        other.confirmed
        and other.age_s == 0.0
        and math.hypot(other.x[0] - north, other.x[1] - east) <= settings.join_share * other.radius
        for other in tracks
    )

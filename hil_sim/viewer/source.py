"""Where the page's pictures come from: a boat under way, or a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol

from twinscrew.hil_sim.viewer.scene import Scene
from twinscrew.hil_sim.viewer.wire import Part

Places = tuple[tuple[float, float, float], ...]
"""Time [s], north, east [m]."""


class Source(Protocol):
    """Gives pictures of vessels at times."""

    @property
    def mode(self) -> Literal["live", "recording"]:
        """Whether time can be chosen."""

    @property
    def names(self) -> Sequence[str]:
        """The vessels."""

    @property
    def scene(self) -> Scene:
        """What stands still."""

    @property
    def duration_s(self) -> float:
        """[s] Of a recording; 0 if it is live."""

    def parts(self, time_s: float) -> Sequence[Part]:
        """Give every vessel's share of the frame at a time; live, of the present one."""

    def now_s(self) -> float:
        """[s] Give the present time on the view's clock; a recording's is its end."""

    def trails(self) -> Mapping[str, Places]:
        """Give where the vessels have been (a recording: all of it)."""

    @property
    def revision(self) -> int:
        """[-] Grows when trails change other than by getting longer: pages are told them anew."""

    def close(self) -> None:
        """Let go of what is open."""

"""Thrusters that take newtons by topic: VRX, and boats whose own nodes drive the motors.

There is no autopilot that could be asked to arm, that a pilot could take the helm from, or that
stops the propellers when nobody commands them. In its place:

- consent at the start: `autopilot.arm`, or `twinscrew run --arm`; without it nothing drives;
- an `enable` (std_msgs/Bool) that is true and goes on coming: who stops sending it, by Ctrl-C or by
  a lost network, stops the boat; one that is false stops it at once, and counts until the sender of
  true has paused and begins anew;
- a process beside the runtime's that sends zero when the runtime no longer does
  (`runtime/vessel/keeper.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.autopilot import topics_of
from twinscrew.runtime.link.transport import NoTransport, Transport
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry, Severity
from twinscrew.runtime.safety.events import (
    ENABLE_LOST,
    ENABLE_REFUSED,
    THRUST_DISABLED,
    THRUST_ENABLED,
    EventKind,
)
from twinscrew.runtime.settings import NonNegative, Settings, convert

if TYPE_CHECKING:
    from twinscrew.runtime.ground.orders import OrderSettings
    from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings

PAUSE_S: Final = 1.0
"""[s] After a false, whoever sends true must have been silent for so long before it counts."""


class ThrusterSettings(Settings, frozen=True):
    """What `autopilot.options` may hold with `autopilot.kind = "thrust"`."""

    enable_max_age_s: NonNegative = 1.0
    """[s] The enable must come again within this time; 0: one is enough, until a false comes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrusterStatus:
    """What is known of who lets us drive; see `AutopilotStatus`."""

    armed: bool
    """Whether somebody consented at the start."""
    enabled: bool
    """Whether the enable holds now."""
    connected: bool = True
    """Nobody answers on the thrusters' topics: they count as there."""
    message_age_s: float = 0.0
    station_age_s: float = math.inf
    """There are no ground stations by way of them,"""
    depth_m: float | None = None
    """nor an echo sounder."""

    @property
    def engaged(self) -> bool:
        """Whether thrust is published."""
        return self.armed and self.enabled

    @property
    def words(self) -> str:
        """As "thrust, armed, enabled"."""
        armed = "armed" if self.armed else "not armed"
        return f"thrust, {armed}, {'enabled' if self.enabled else 'not enabled'}"


class ThrusterLink:
    """Decides who may drive; the thrust itself is published by the vessel's driver."""

    topics = topics_of("thrust")
    stations = None

    def __init__(self, settings: ThrusterSettings | None = None, *, armed: bool = False) -> None:
        self._settings = settings or ThrusterSettings()
        self._armed = armed
        self._enabled = self._barred = False
        self._true_s = self._now_s = -math.inf
        self._news: list[tuple[EventKind, str]] = []

    def open(self, stop: Callable[[], bool]) -> Transport:  # noqa: ARG002
        """See `Autopilot`; there is nothing to open."""
        return NoTransport()

    def receive(self, data: bytes, now_s: float) -> None:
        """See `Autopilot`; no bytes come."""

    def hear(self, topic: str, payload: bytes, now_s: float) -> None:  # noqa: ARG002
        """Take an enable, or its end.

        Raises
        ------
        MessageError
            It is none.
        """
        enable = cdr.decode_enable(payload)
        self._age(now_s)
        if not enable:
            if self._enabled:
                self._news.append((THRUST_DISABLED, ""))
            self._enabled, self._barred = False, True
            return
        paused = now_s - self._true_s > PAUSE_S
        self._true_s = now_s
        if self._barred and not paused:
            return
        self._barred = False
        if not self._enabled:
            self._enabled = True
            without = (ENABLE_REFUSED, "nobody consented at the start: autopilot.arm, run --arm")
            self._news.append((THRUST_ENABLED, "") if self._armed else without)

    def command(self, thrust: Float64 | None, now_s: float) -> bytes:  # noqa: ARG002
        """See `Autopilot`; the command goes by topic."""
        self._age(now_s)
        return b""

    def tick(self, now_s: float, *, may_ask: bool = True) -> bytes:  # noqa: ARG002
        """See `Autopilot`; there is nobody to talk to."""
        self._age(now_s)
        return b""

    def events(self, now_s: float) -> tuple[HealthEvent, ...]:
        """See `Autopilot`."""
        self._age(now_s)
        news, self._news = self._news, []
        return tuple(kind.at(round(now_s * 1e9), detail) for kind, detail in news)

    @property
    def status(self) -> ThrusterStatus:
        """See `Autopilot`."""
        return ThrusterStatus(armed=self._armed, enabled=self._enabled)

    def take_outputs(self) -> None:
        """There are no pulses: thrusters take newtons."""

    def take_odometry(self) -> list[Odometry]:
        """See `Autopilot`; it tells none."""
        return []

    def take_fences(self) -> None:
        """See `Autopilot`; they hold none."""

    def take_ais(self) -> list[tuple[float, str]]:
        """See `Autopilot`; it has no receiver."""
        return []

    def tell(self, messages: Iterable[Message]) -> None:
        """See `Autopilot`; there are no ground stations."""

    def say(self, text: str, severity: Severity) -> None:
        """See `Autopilot`; there are no ground stations."""

    def _age(self, now_s: float) -> None:
        """Let an enable that has not come again come to its end."""
        self._now_s = now_s
        longest_s = self._settings.enable_max_age_s
        if self._enabled and 0.0 < longest_s < now_s - self._true_s:
            self._enabled = False
            self._news.append((ENABLE_LOST, f"the last came {now_s - self._true_s:.2f} s ago"))


def make(settings: AutopilotSettings, orders: OrderSettings | None = None) -> ThrusterLink:  # noqa: ARG001
    """Make the thrusters of `autopilot.kind = "thrust"`; ground stations do not reach them.

    Raises
    ------
    ConfigError
        There is an option that is not one of `ThrusterSettings`.
    """
    try:
        options = convert(settings.options, ThrusterSettings)
    except ConfigError as error:
        words = str(error).removeprefix(f"{error.key}: ")
        raise ConfigError(words, key=f"autopilot.options.{error.key}") from error
    return ThrusterLink(options, armed=settings.arm)

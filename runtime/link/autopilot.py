"""What a vessel needs of an autopilot, and which kinds of autopilots there are.

`Autopilot` is all that the vessel and its drivers know of one. It has no clock, no thread and no
socket of its own: bytes go in and come out, with the time, so that the same code runs on a boat, in
simulated time and in a test. Another kind of autopilot is a folder beside `ardupilot/` with a class
that has these methods, and a line in `AUTOPILOTS`; `autopilot.kind` chooses it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Final, Protocol

from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry, Severity

if TYPE_CHECKING:
    from twinscrew.runtime.charts.static_map import Feature
    from twinscrew.runtime.ground.orders import OrderSettings
    from twinscrew.runtime.ground.stations import Stations
    from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings


class AutopilotStatus(Protocol):
    """What is known of an autopilot, as of its last call."""

    @property
    def connected(self) -> bool:
        """Whether it is heard. While it is not, the thrust is zero."""

    @property
    def engaged(self) -> bool:
        """Whether thrust commands act: it is armed, nobody else drives, and it obeys.

        The policy decides on thrust only then, and is asked afresh when this begins.
        """

    @property
    def message_age_s(self) -> float:
        """[s] Since it was last heard; infinite if it never was."""

    @property
    def station_age_s(self) -> float:
        """[s] Since a ground station was heard by way of it; infinite if none ever was."""

    @property
    def depth_m(self) -> float | None:
        """[m] Of the water under its echo sounder; None if it does not say."""

    @property
    def words(self) -> str:
        """A few words for an operator, as "MANUAL, armed, 12.6 V 87 %"."""


class Autopilot(Protocol):
    """One autopilot: who holds the propellers, and what it says.

    Times are the driver's monotonic clock, or simulated time [s]. No method but `open` may raise
    on what an autopilot says or does.
    """

    @property
    def stations(self) -> Stations | None:
        """The ground stations that give orders by way of it; None if it carries no orders."""

    @property
    def status(self) -> AutopilotStatus:
        """What is known of it, as of the last call."""

    def open(self, stop: Callable[[], bool]) -> Transport:
        """Open what carries the bytes; a driver in real time calls it once, at the start.

        One that is commanded by topics alone gives a `NoTransport`.

        Parameters
        ----------
        stop
            Says that nobody wants it any more: ends the wait for one that is not there yet.

        Raises
        ------
        LinkError
            It cannot be opened.
        """

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes that came from it: any number, cut anywhere, whatever they are."""

    def command(self, thrust: Float64 | None, now_s: float) -> bytes:
        """Ask for thrust, and give the bytes to send; called with each decision and tick.

        Parameters
        ----------
        thrust : (2,) float64, or None
            [N] Left, right, finite and within the limits. None: nothing is wanted, and who holds
            the helm may have it.
        now_s
            [s] The driver's time. Where no command came for long, the propellers must stop.

        Returns
        -------
        bytes
            They ask for no thrust unless `status.engaged`; empty if the command goes another way
            (every command is published on the topics `thrust_left` and `thrust_right`, too).
        """

    def tick(self, now_s: float, *, may_ask: bool = True) -> bytes:
        """Give the bytes that keep the conversation going, at least 20 times a second.

        Parameters
        ----------
        now_s
            [s] The driver's time.
        may_ask
            Whether it may be asked to arm and to let us drive; False while we could not.
        """

    def events(self, now_s: float) -> tuple[HealthEvent, ...]:
        """Give what an operator should know: what began, ended or was said since the last call."""

    def take_outputs(self) -> tuple[int, int] | None:
        """Give what drives the propellers [us], left and right, if it was told since last asked."""

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of the topics (`TOPICS`) that it wants to hear, beside its bytes."""

    def hear(self, topic: str, payload: bytes, now_s: float) -> None:
        """Take a message of one of its topics.

        Raises
        ------
        MessageError
            It is not the message that it should be: a `bad_message` event.
        """

    def take_odometry(self) -> list[Odometry]:
        """Give the odometry that it told since the last call, stamped in the driver's time.

        It is used where `odometry_source = "autopilot"`.
        """

    def take_ais(self) -> list[tuple[float, str]]:
        """Give what it has forwarded of AIS since the last call: age [s], sentence of NMEA 0183.

        Empty for one that has no receiver.
        """

    def take_fences(self) -> tuple[Feature, ...] | str | None:
        """Give all the fences that it holds, where they have changed since the last call.

        None if they have not, or it knows of none; words if it holds some that cannot be placed.
        """

    def tell(self, messages: Iterable[Message]) -> None:
        """Show ground stations MAVLink messages; one that carries none leaves them out."""

    def say(self, text: str, severity: Severity) -> None:
        """Say something in plain words to ground stations; so."""


AUTOPILOTS: Final = {
    "ardupilot": "twinscrew.runtime.link.ardupilot.link:make",
    "thrust": "twinscrew.runtime.link.thrusters:make",
}
"""Kinds of autopilots by name: where a function (settings, orders) -> `Autopilot` is found."""


TOPICS_OF: Final[dict[str, tuple[str, ...]]] = {"thrust": ("enable",)}
"""What kinds want to hear on the bus (`Autopilot.topics`); those not named here: nothing."""


def topics_of(kind: str) -> tuple[str, ...]:
    """Give the topics that a kind of autopilot wants to hear."""
    return TOPICS_OF.get(kind, ())


def make_autopilot(settings: AutopilotSettings, orders: OrderSettings | None = None) -> Autopilot:
    """Make the configured kind of autopilot.

    Parameters
    ----------
    settings
        The table `autopilot`; a kind has what is its own in `options`.
    orders
        What ground stations may order by way of it; None: nothing.

    Raises
    ------
    ConfigError
        There is no such kind, or it cannot use its settings.
    """
    if settings.kind not in AUTOPILOTS:
        raise ConfigError(one_of(settings.kind, AUTOPILOTS), key="autopilot.kind")
    module, _, name = AUTOPILOTS[settings.kind].partition(":")
    autopilot: Autopilot = getattr(import_module(module), name)(settings, orders)
    return autopilot

"""An autopilot that is no ArduPilot and speaks no MAVLink: lines of text, one word and numbers.

    autopilot -> vessel   MODE auto|helm     who has the propellers
                          AT north east heading surge sway yaw_rate
    vessel -> autopilot   THRUST left right  [N]
                          HELLO

`TextAutopilot` is the vessel's end, `TextBoat` the other one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from twinscrew.runtime.geometry import euler_from_quaternion, quaternion_from_euler
from twinscrew.runtime.ground.orders import OrderSettings
from twinscrew.runtime.link.ardupilot.settings import AutopilotSettings
from twinscrew.runtime.link.transport import Transport, await_transport, reopening
from twinscrew.runtime.messages.types import Float64, HealthEvent, Odometry, Severity
from twinscrew.runtime.safety.events import AUTOPILOT_RECOVERED, AUTOPILOT_SILENT

NUMBERS = {"AT": 6, "THRUST": 2}


def words_of(line: bytes) -> tuple[str, list[float]]:
    """Read a line; an empty word if it is damaged."""
    try:
        word, *rest = line.decode("ascii").split()
        if word == "MODE" and rest in (["auto"], ["helm"]):
            return rest[0], []
        numbers = [float(text) for text in rest]
        if len(numbers) != NUMBERS.get(word, 0) or not all(map(math.isfinite, numbers)):
            return "", []
        return word, numbers
    except ValueError:
        return "", []


class TextAutopilot:
    """The vessel's end: an `Autopilot` by its methods alone."""

    stations = None
    topics = ()

    def __init__(self, settings: AutopilotSettings) -> None:
        self._settings = settings
        self._silent_after_s = float(settings.options.get("silent_after_s", 0.5))
        self._rest = b""
        self._mode = "helm"
        self._heard_s = self._now_s = -math.inf
        self._was_silent = False
        self._odometry: list[Odometry] = []

    def hear(self, topic: str, payload: bytes, now_s: float) -> None: ...

    @property
    def status(self) -> TextAutopilot:
        return self

    @property
    def connected(self) -> bool:
        return self.message_age_s <= self._silent_after_s

    @property
    def engaged(self) -> bool:
        return self.connected and self._mode == "auto"

    @property
    def message_age_s(self) -> float:
        return math.inf if self._heard_s == -math.inf else self._now_s - self._heard_s

    @property
    def station_age_s(self) -> float:
        return math.inf  # it carries nobody's words but its own

    @property
    def depth_m(self) -> None:
        return None

    @property
    def words(self) -> str:
        return self._mode if self.connected else "silent"

    def open(self, stop: Callable[[], bool]) -> Transport:
        connection = self._settings.connection
        return reopening(connection, await_transport(connection, self._settings.wait_s, stop))

    def receive(self, data: bytes, now_s: float) -> None:
        self._now_s = now_s
        *lines, self._rest = (self._rest + data)[-4096:].split(b"\n")
        for line in lines:
            word, numbers = words_of(line)
            if word in ("auto", "helm"):
                self._mode, self._heard_s = word, now_s
            elif word == "AT":
                self._odometry.append(odometry_of(numbers, round(now_s * 1e9)))

    def command(self, thrust: Float64 | None, now_s: float) -> bytes:
        self._now_s = now_s
        left, right = thrust if thrust is not None and self.engaged else (0.0, 0.0)
        return f"THRUST {left:.3f} {right:.3f}\n".encode()

    def tick(self, now_s: float, *, may_ask: bool = True) -> bytes:
        self._now_s = now_s
        return b"HELLO\n"

    def events(self, now_s: float) -> tuple[HealthEvent, ...]:
        self._now_s = now_s
        was, self._was_silent = self._was_silent, not self.connected
        if was == self._was_silent:
            return ()
        stamp_ns = round(now_s * 1e9)
        begun, over = AUTOPILOT_SILENT.at(stamp_ns), AUTOPILOT_RECOVERED.at(stamp_ns)
        return (begun if self._was_silent else over,)

    def take_fences(self) -> None:
        """It holds none."""

    def take_ais(self) -> list[tuple[float, str]]:
        """It has no receiver."""
        return []

    def take_odometry(self) -> list[Odometry]:
        given, self._odometry = self._odometry, []
        return given

    def take_outputs(self) -> tuple[int, int] | None:
        return None

    def tell(self, messages: Iterable[object]) -> None:
        pass

    def say(self, text: str, severity: Severity) -> None:
        pass


def make(settings: AutopilotSettings, orders: OrderSettings | None) -> TextAutopilot:
    return TextAutopilot(settings)


def odometry_of(numbers: list[float], stamp_ns: int) -> Odometry:
    north, east, heading, surge, sway, yaw_rate = numbers
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=np.array([north, east, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.array([surge, sway, 0.0]),
        rates_B=np.array([0.0, 0.0, yaw_rate]),
    )


class TextBoat:
    """The boat's end: holds the last thrust, and tells mode and place."""

    def __init__(self) -> None:
        self.mode = "auto"
        self.thrust = np.zeros(2)
        self.hellos = 0
        self._rest = b""

    def receive(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            word, numbers = words_of(line)
            assert word in ("THRUST", "HELLO"), line
            self.hellos += word == "HELLO"
            if word == "THRUST":
                self.thrust = np.array(numbers)

    def says(self, true: Odometry) -> bytes:
        _, _, heading = euler_from_quaternion(true.q_NB)
        at = (*true.position_N[:2], heading, *true.velocity_B[:2], true.rates_B[2])
        place = " ".join(f"{value:.6f}" for value in at)
        return f"MODE {self.mode}\nAT {place}\n".encode()

"""What lines do to messages: each effect takes one in, and gives what comes out at the end."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.random import Generator

from twinscrew.hil_sim.faults.kinds import Corrupt


class Effect(Protocol):
    """Something that happens to the messages of a line, in their order; times are the caller's."""

    def put(self, payload: bytes, now_s: float) -> list[bytes]:
        """Take a message in; give what comes out at once."""

    def due(self, now_s: float) -> list[bytes]:
        """Give what comes out by itself by now."""

    def rest(self) -> list[bytes]:
        """Give what is still inside when the effect ends."""


class Immediate:
    """An effect that keeps nothing back."""

    def due(self, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        return []

    def rest(self) -> list[bytes]:
        """See `Effect`."""
        return []


class Dropping(Immediate):
    """Some messages are lost."""

    def __init__(self, share: float, rng: Generator) -> None:
        self._share, self._rng = share, rng

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        return [] if self._rng.random() < self._share else [payload]


class Duplicating(Immediate):
    """Every message comes several times."""

    def __init__(self, copies: int) -> None:
        self._times = 1 + copies

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        return [payload] * self._times


class Corrupting(Immediate):
    """Bits are turned, or the end is missing."""

    def __init__(self, settings: Corrupt, rng: Generator) -> None:
        self._settings, self._rng = settings, rng

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        settings, rng = self._settings, self._rng
        if rng.random() >= settings.share or not payload:
            return [payload]
        damaged = np.frombuffer(payload, dtype=np.uint8).copy()
        at = rng.integers(0, 8 * len(damaged), size=settings.bits)
        np.bitwise_xor.at(damaged, at // 8, (1 << (at % 8)).astype(np.uint8))
        return [damaged[: round(settings.keep * len(damaged))].tobytes()]


class Delaying:
    """Messages come later; when that ends, all that is on its way comes at once."""

    def __init__(self, delay_s: float) -> None:
        self._delay_s = delay_s
        self._under_way: list[tuple[float, bytes]] = []

    def put(self, payload: bytes, now_s: float) -> list[bytes]:
        """See `Effect`."""
        self._under_way.append((now_s + self._delay_s, payload))
        return []

    def due(self, now_s: float) -> list[bytes]:
        """See `Effect`."""
        out = [payload for time_s, payload in self._under_way if time_s <= now_s]
        self._under_way = self._under_way[len(out) :]
        return out

    def rest(self) -> list[bytes]:
        """See `Effect`."""
        out = [payload for _, payload in self._under_way]
        self._under_way = []
        return out


class Reordering(Immediate):
    """Some messages are overtaken by the one behind them."""

    def __init__(self, share: float, rng: Generator) -> None:
        self._share, self._rng = share, rng
        self._held: bytes | None = None

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        if self._held is not None:
            held, self._held = self._held, None
            return [payload, held]
        if self._rng.random() < self._share:
            self._held = payload
            return []
        return [payload]

    def rest(self) -> list[bytes]:
        """See `Effect`."""
        held, self._held = self._held, None
        return [] if held is None else [held]

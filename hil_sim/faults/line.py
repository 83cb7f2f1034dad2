"""A line with whatever is wrong with it now."""

from __future__ import annotations

from twinscrew.hil_sim.faults.effects import Effect


class Line:
    """Messages of one topic, or one direction of MAVLink; effects follow one another."""

    def __init__(self) -> None:
        self._effects: list[Effect] = []
        self._released: list[bytes] = []
        self.last: bytes | None = None
        """The last message that was sent, whatever became of it."""

    def add(self, effect: Effect) -> None:
        """Let something go wrong from now on."""
        self._effects.append(effect)

    def remove(self, effect: Effect) -> None:
        """Let it end; what was still inside is due at once."""
        self._effects.remove(effect)
        self._released += effect.rest()

    def put(self, payload: bytes, now_s: float) -> list[bytes]:
        """Send a message; give what arrives at once, in order."""
        self.last = payload
        return self._through([payload], 0, now_s)

    def due(self, now_s: float) -> list[bytes]:
        """Give what arrives by itself by now."""
        arrived, self._released = self._released, []
        for at, effect in enumerate(self._effects):
            arrived += self._through(effect.due(now_s), at + 1, now_s)
        return arrived

    def _through(self, payloads: list[bytes], first: int, now_s: float) -> list[bytes]:
        for effect in self._effects[first:]:
            payloads = [out for payload in payloads for out in effect.put(payload, now_s)]
        return payloads

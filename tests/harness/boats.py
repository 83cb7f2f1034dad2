"""Boats that say again what they said in a run, for whoever looks on."""

import threading

from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import find_recordings

LAST = 100
"""[-] Messages of a boat that are said again: those of about 1.3 s."""


class Boats:
    """Two boats that say again and again what they said in a run, on one endpoint."""

    def __init__(self, run, endpoint):
        self.bus = ZenohBus(ZenohSettings(listen=(endpoint,), connect=()), "wamv1")
        recordings = find_recordings(run)
        self.said = {r.vessel: list(r.messages()) for r in recordings}
        self.last = {
            name: cdr.decode_odometry(
                next(m.payload for m in reversed(said) if m.topic == "odometry")
            )
            for name, said in self.said.items()
        }
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self):
        while not self._stop.wait(0.05):
            for name, said in self.said.items():
                face = self.bus.within(name)
                for message in said[-LAST:]:
                    if message.topic != "engagement":
                        face.publish(message.topic, message.payload)

    def close(self):
        self._stop.set()
        self._thread.join()
        self.bus.close()

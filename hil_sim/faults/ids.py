"""MAVLink frames with another sender's ids, whole otherwise."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.faults.effects import Immediate
from twinscrew.hil_sim.faults.kinds import WrongIds
from twinscrew.runtime.mavlink import Wire


class Impersonating(Immediate):
    """Every frame is packed anew, as another system's or component's."""

    def __init__(self, settings: WrongIds) -> None:
        self._settings = settings
        self._wire = Wire(1, 1)

    def put(self, payload: bytes, now_s: float) -> list[bytes]:  # noqa: ARG002
        """See `Effect`."""
        return [self._packed(message) for message in self._wire.decode(payload)]

    def _packed(self, message: mavlink.MAVLink_message) -> bytes:
        settings = self._settings
        system = settings.system_id or message.get_srcSystem()
        component = settings.component_id or message.get_srcComponent()
        frame: bytes = message.pack(mavlink.MAVLink(None, system, component))
        return frame

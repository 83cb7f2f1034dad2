"""Which messages an autopilot hands on between its ports, and which it takes for itself.

ArduPilot's rules (its MAVLink routing, read in its sources): it remembers on which port it has
heard each component. What is for everybody goes to all the others; what is for another component
of the vehicle goes where that component was heard, and only if it never was does the autopilot take
it for itself. Heartbeats go to every port but those where their sender lives.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.mavlink import Message

BROADCAST = 0
_NOT_HANDED_ON = frozenset({"RADIO", "RADIO_STATUS", "ADSB_VEHICLE"})


class Routes:
    """Who lives on which port.

    Parameters
    ----------
    us
        The autopilot's system and component.
    ports
        [-] How many ports it has.
    """

    def __init__(self, us: tuple[int, int], ports: int) -> None:
        self._us = us
        self._ports = range(ports)
        self._homes: dict[tuple[int, int], set[int]] = {}

    def route(self, message: Message, port: int) -> tuple[bool, set[int]]:
        """Learn from a message that came by a port.

        Returns
        -------
        locally : bool
            Whether the autopilot takes it.
        others : set of int
            The ports that it goes out by.
        """
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if sender == self._us:
            return True, set()
        homes = self._homes.setdefault(sender, set())
        homes.add(port)
        kind = message.get_type()
        if kind == "HEARTBEAT":
            return True, set(self._ports) - homes
        if kind in _NOT_HANDED_ON:
            return True, set()
        return self._by_target(_target(message), port)

    def _by_target(self, target: tuple[int, int], port: int) -> tuple[bool, set[int]]:
        system, component = target
        if target == self._us:
            return True, set()
        everybody = system == BROADCAST
        others = {
            home
            for (known, part), homes in self._homes.items()
            for home in homes
            if everybody
            or (known == system and (component in (BROADCAST, part) or system != self._us[0]))
        } - {port}
        ours = everybody or system == self._us[0]
        locally = ours and component in (BROADCAST, self._us[1])
        return locally or (ours and not others), others


def _target(message: Message) -> tuple[int, int]:
    """Give the system and component that a message is for; 0 for all."""
    if message.get_type() == "MANUAL_CONTROL":
        return int(message.target), BROADCAST
    system = getattr(message, "target_system", BROADCAST)
    return int(system), int(getattr(message, "target_component", BROADCAST))


AUTOPILOT = int(mavlink.MAV_COMP_ID_AUTOPILOT1)
"""The component that an autopilot is."""

"""The parameter table of the simulated autopilot: names, values, order, and how it is asked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.errors import ConfigError, one_of
from twinscrew.runtime.link.ardupilot.parameters import read_parm
from twinscrew.runtime.mavlink import Message
from twinscrew.runtime.settings import CONFIG_DIR

SHIPPED = CONFIG_DIR / "autopilot" / "ardurover.parm"
"""What a boat is set up with; the simulated autopilot starts from the same file."""

SIMULATION = CONFIG_DIR / "autopilot" / "simulation.parm"
"""What only a simulated autopilot may have, a real ArduRover's simulator among them."""
CALIBRATED = tuple(
    f"INS_{accelerometer}OFFS_{axis}" for accelerometer in ("ACC", "ACC2") for axis in "XYZ"
)
"""Accelerometers count as calibrated if none of these is 0 (read: AP_InertialSensor)."""

_FACTORY: Mapping[str, float] = {
    "SYSID_THISMAV": 1.0,
    "ARMING_CHECK": 1.0,
    "FS_GCS_ENABLE": 0.0,
    "SIM_RC_FAIL": 1.0,  # ArduPilot's simulator only: 0 gives it a receiver, 1 none
    "SIM_DEPTH": 0.0,  # ours: metres of water under an echo sounder; 0: there is none
    "SERVO2_FUNCTION": 0.0,
    "SERVO4_FUNCTION": 0.0,
    **dict.fromkeys(CALIBRATED, 0.0),
    **{name.replace("OFFS", "SCAL"): 1.0 for name in CALIBRATED},
}
"""Parameters of the real one that twinscrew does not depend on, at their factory values."""


class Parameters:
    """Named numbers in a fixed order, as PARAM_VALUE counts them."""

    def __init__(self, system_id: int, changes: Mapping[str, float]) -> None:
        """Start from the shipped file, for a system id, with some values changed."""
        self._values = {**_FACTORY, **read_parm(SHIPPED)}
        self._values |= {"SYSID_THISMAV": float(system_id), "SYSID_MYGCS": float(system_id)}
        for name, value in changes.items():
            if name not in self._values:
                raise ConfigError(one_of(name, sorted(self._values)), key="parameters")
            self._values[name] = float(value)
        self._indices = {name: index for index, name in enumerate(sorted(self._values))}
        self.changes = 0
        """[-] How often a value was set since the start."""
        self.written: set[str] = set()
        """The names that were: what a real one keeps when it is switched off."""

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def get(self, name: str, otherwise: float) -> float:
        """Give a value, or `otherwise` if there is no such parameter."""
        return self._values.get(name, otherwise)

    def set(self, name: str, value: float) -> None:
        """Change a parameter; one that does not exist, or no finite number, is ignored."""
        if name in self._values and math.isfinite(value):
            self._values[name] = value
            self.changes += 1
            self.written.add(name)

    def answer(self, request: Message) -> Iterable[Message]:
        """Carry out PARAM_REQUEST_LIST, PARAM_REQUEST_READ or PARAM_SET; gives the answers."""
        if request.get_type() == "PARAM_REQUEST_LIST":
            return [self._tell(name) for name in self._indices]
        if request.get_type() == "PARAM_SET":
            self.set(request.param_id, request.param_value)
        index = getattr(request, "param_index", -1)
        name = request.param_id if index == -1 else self._name(index)
        return [self._tell(name)] if name in self._indices else []

    def _name(self, index: int) -> str:
        names = list(self._indices)
        return names[index] if 0 <= index < len(names) else ""

    def _tell(self, name: str) -> Message:
        return mavlink.MAVLink_param_value_message(
            name.encode("ascii"),
            self._values[name],
            mavlink.MAV_PARAM_TYPE_REAL32,
            len(self._indices),
            self._indices[name],
        )

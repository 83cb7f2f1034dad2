"""What the link knows of the autopilot, as one frozen record."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotStatus:
    """The autopilot as the link sees it now."""

    connected: bool
    """Whether it is heard."""
    armed: bool
    mode: str
    """Name of its mode, as "MANUAL"; "unknown" before the first heartbeat."""
    vehicle_type: int | None
    """MAV_TYPE of its heartbeat; 11 is a surface boat."""
    is_boat: bool
    """Whether it is an ArduPilot surface boat."""
    pilot_has_it: bool
    """Whether a pilot chose another mode than MANUAL."""
    failsafe_hold: bool
    """Whether its radio failsafe holds the boat."""
    obeying: bool | None
    """Whether its outputs follow our commands; None while nobody can tell (all at stop)."""
    outputs_us: tuple[int, int] | None
    """[us] Left, right: what drives the propellers, as SERVO_OUTPUT_RAW says."""
    message_age_s: float
    """[s] Since the last message of any kind; infinite if there was none."""
    heartbeat_age_s: float
    """[s] Since the last heartbeat."""
    bad_frames: int
    """[-] Frames refused so far: damaged, or not signed as they should be."""
    old_frames: int
    """[-] Frames of MAVLink 1 that came; ArduPilot sends them until it hears MAVLink 2."""
    parameters_wrong: tuple[str, ...]
    """Words about each parameter that is not what it must be."""
    parameters_unsafe: tuple[str, ...]
    """Words about each parameter that forbids driving: wrong, missing, or not read yet."""
    engaged: bool
    """Whether thrust commands act: heard, a boat of ours, armed, in MANUAL mode, with the right
    parameters, and not disobeying."""
    battery_v: float | None = None
    """[V] As the autopilot measures it; None if it has not said."""
    battery_percent: int | None = None
    """[%] What is left of it; None if the autopilot does not know."""

    @property
    def words(self) -> str:
        """Mode, arming and battery, as "MANUAL, armed, 12.6 V 87 %"."""
        if not self.connected:
            return "silent"
        parts = [self.mode, "armed" if self.armed else "disarmed"]
        if self.battery_v is not None:
            left = "" if self.battery_percent is None else f" {self.battery_percent} %"
            parts.append(f"{self.battery_v:.1f} V{left}")
        return ", ".join(parts)

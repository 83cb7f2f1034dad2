"""`diagnostic_msgs/DiagnosticArray`: health events as ROS tools show them."""

from __future__ import annotations

from typing import Final

from twinscrew.runtime.messages.header import read_header, write_header
from twinscrew.runtime.messages.types import HealthEvent, Severity
from twinscrew.runtime.messages.wire import Reader, Writer

DIAGNOSTICS_TYPE: Final = "diagnostic_msgs/msg/DiagnosticArray"

_LEVELS: Final = (Severity.INFO, Severity.WARNING, Severity.ERROR)
"""diagnostic_msgs/DiagnosticStatus: 0 OK, 1 WARN, 2 ERROR (3 STALE is an error to us)."""
_SMALLEST_STATUS: Final = 20
"""[B] A level, three empty strings and no values, without most of the padding."""
_SMALLEST_VALUE: Final = 8


def encode_diagnostics(
    events: tuple[HealthEvent, ...], *, stamp_ns: int, hardware_id: str = ""
) -> bytes:
    """Write a diagnostic_msgs/DiagnosticArray, one status an event; the vessel is the hardware."""
    writer = Writer()
    write_header(writer, stamp_ns, "")
    writer.values("I", 4, len(events))
    for event in events:
        writer.values("B", 1, _LEVELS.index(event.severity))
        writer.string(event.name)
        writer.string(event.detail)
        writer.string(hardware_id)
        writer.values("I", 4, 0)
    return writer.payload()


def decode_diagnostics(payload: bytes | memoryview) -> tuple[HealthEvent, ...]:
    """Read a diagnostic_msgs/DiagnosticArray; every event gets the array's stamp."""
    reader = Reader(payload, DIAGNOSTICS_TYPE)
    stamp_ns, _ = read_header(reader)
    count = reader.count(_SMALLEST_STATUS)
    events = tuple(_read_status(reader, stamp_ns) for _ in range(count))
    reader.end()
    return events


def _read_status(reader: Reader, stamp_ns: int) -> HealthEvent:
    severity = _LEVELS[min(reader.uint8(), len(_LEVELS) - 1)]
    name, detail, _ = reader.string(), reader.string(), reader.string()
    for _ in range(reader.count(_SMALLEST_VALUE)):
        reader.string()
        reader.string()
    return HealthEvent(stamp_ns=stamp_ns, name=name, severity=severity, detail=detail)

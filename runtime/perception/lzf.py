"""LZF decompression, as PCD's binary_compressed needs it.

A control byte below 32 is followed by one byte more than it says, taken as they are. Any other
starts a copy of what was already written: its upper 3 bits are the length less 2 (7: the next byte
is added), its lower 5 bits and one more byte the distance back less 1.
"""

from __future__ import annotations

from twinscrew.runtime.errors import MessageError

LITERAL = 32


def decompress(data: bytes, size: int) -> bytes:
    """Give the `size` bytes that `data` holds.

    Raises
    ------
    MessageError
        The data end early, reach back before their beginning, or hold another number of bytes.
    """
    out, at = bytearray(), 0
    try:
        while at < len(data) and len(out) <= size:
            control = data[at]
            at += 1
            if control < LITERAL:
                out += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            start = len(out) - ((control & 31) << 8) - data[at] - 1
            at += 1
            _copy(out, start, length + 2)
    except IndexError as error:
        raise MessageError("LZF: the data end early") from error
    if len(out) != size or at > len(data):
        raise MessageError(f"LZF: {len(out)} bytes, not {size}")
    return bytes(out)


def _copy(out: bytearray, start: int, length: int) -> None:
    """Repeat what was written from `start`; the copy may overlap itself."""
    if start < 0:
        raise MessageError("LZF: a copy from before the beginning")
    while length > 0:
        piece = out[start : start + length]
        out += piece
        length -= len(piece)

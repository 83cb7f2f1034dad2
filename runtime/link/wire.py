"""MAVLink 2 (and no older one) on the wire: bytes to messages and back, without any socket.

The dialect module does the encoding; the framing is ours, because a false start byte must not
swallow the good frames behind it, and because a peer without the key must not be able to move a
stream's signing clock (see `signing`). pymavlink.mavutil is not needed, and costs start-up time.
"""

from __future__ import annotations

import struct
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.signing import Signing, authentic_time, signed_codec

Message: TypeAlias = Any
"""A message of the dialect: `mavlink.MAVLink_*_message` (pymavlink carries no stub files)."""

_START = bytes([mavlink.PROTOCOL_MARKER_V2])
_OLD_START = bytes([mavlink.PROTOCOL_MARKER_V1])
_CRC_LENGTH = 2
MOST_FALSE_STARTS = 1000
"""[-] Beginnings a call that turn out to be none: each costs some 4 us. Noise has one in 256 bytes,
and the fastest serial line brings 5 kB between two ticks."""
MOST_LOOKED_AT = 20
"""[-] Beginnings in a datagram of a stranger's: a sender of MAVLink begins it with a frame."""
MOST_MESSAGES = 1000
"""[-] Messages a call: each costs some 6 us, and as much again to answer. The fastest serial line
brings 400 between two ticks."""


class Wire:
    """One end of a MAVLink connection.

    Parameters
    ----------
    system_id, component_id
        Who we say we are.
    signing
        Sign what goes out and refuse what is not signed with the same key; None to do neither.
    """

    def __init__(self, system_id: int, component_id: int, signing: Signing | None = None) -> None:
        self.bad_frames = 0
        """[-] Frames refused so far: damaged, or not signed as they should be."""
        self.old_frames = 0
        """[-] How often what came began as a MAVLink 1 frame, which is not read."""
        self._signing = signing
        self._codec = (
            mavlink.MAVLink(None, system_id, component_id)
            if signing is None
            else signed_codec(system_id, component_id, signing)
        )
        self._buffer = bytearray()

    @property
    def system_id(self) -> int:
        """[-] The system we speak as."""
        return int(self._codec.srcSystem)

    def encode(self, message: Message) -> bytes:
        """Give the frame of a message, numbered and, if asked for, signed."""
        if self._signing is not None:
            self._signing.advance(self._codec)
        frame: bytes = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        return frame

    def decode(self, data: bytes) -> list[Message]:
        """Give the messages that `data` completes; damaged and unknown ones are left out.

        The work is bounded: what follows `MOST_MESSAGES` messages or `MOST_FALSE_STARTS` beginnings
        of none is thrown away, as a radio would lose it.
        """
        if self._signing is not None:
            self._signing.advance(self._codec)
        self.old_frames += data[:1] == _OLD_START
        buffer = self._buffer
        buffer += data
        messages: list[Message] = []
        start = false_starts = 0
        while (start := buffer.find(_START, start)) >= 0:
            if false_starts >= MOST_FALSE_STARTS or len(messages) >= MOST_MESSAGES:
                self.bad_frames += 1
                break
            length = _frame_length(buffer, start)
            if length is None or start + length > len(buffer):
                whole = self._whole_frame_after(start)
                if whole is None:
                    del buffer[:start]
                    return messages
                start = whole  # turned bits gave a length that would have held all of this up
                continue
            message = self._decode_frame(buffer[start : start + length]) if length else None
            if message is None:
                start += 1  # a false start, a damaged or unknown frame: a good one may lie inside
                false_starts += 1
                continue
            start += length
            messages.append(message)
        buffer.clear()
        return messages

    def recognises(self, datagram: bytes) -> bool:
        """Tell whether a datagram carries a frame of our vehicle's autopilot; nothing is taken in.

        The frame has its checksum; with signing it is signed with our key, and newer than all that
        was heard on its stream.
        """
        start = -1
        for _ in range(MOST_LOOKED_AT):
            start = datagram.find(_START, start + 1)
            if start < 0:
                return False
            length = _frame_length(datagram, start)
            if length and self._is_the_autopilots(datagram[start : start + length], length):
                return True
        return False

    def _is_the_autopilots(self, frame: bytes, length: int) -> bool:
        sender = (self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        if len(frame) < length or tuple(frame[5:7]) != sender or not _is_intact(frame, 0):
            return False
        if self._signing is None:
            return True
        self._signing.advance(self._codec)
        signed = bool(frame[2] & mavlink.MAVLINK_IFLAG_SIGNED)
        return signed and authentic_time(self._codec.signing, frame, *sender) is not None

    def _whole_frame_after(self, start: int) -> int | None:
        """Give where the next frame lies that is complete and has its checksum, if one does."""
        buffer = self._buffer
        while (start := buffer.find(_START, start + 1)) >= 0:
            length = _frame_length(buffer, start)
            if length and start + length <= len(buffer) and _is_intact(buffer, start):
                return start
        return None

    def _decode_frame(self, frame: bytearray) -> Message | None:
        try:
            message = self._codec.decode(frame)
            # one that the dialect does not know was not checked: it has no name to check it by
            return None if message.get_msgId() == mavlink.MAVLINK_MSG_ID_UNKNOWN else message
        except (mavlink.MAVError, struct.error, ValueError):
            self.bad_frames += 1
            return None


def _frame_length(buffer: bytes | bytearray, start: int) -> int | None:
    """Give the whole frame's length [bytes], 0 if it cannot be one, None if that cannot be told."""
    if len(buffer) - start < 3:
        return None
    payload, flags = buffer[start + 1], buffer[start + 2]
    if flags & ~mavlink.MAVLINK_IFLAG_SIGNED:
        return 0
    signature = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN if flags else 0
    return int(mavlink.HEADER_LEN_V2) + payload + _CRC_LENGTH + signature


def _is_intact(buffer: bytes | bytearray, start: int) -> bool:
    """Tell whether a frame of a known kind has its checksum; this decodes and counts nothing."""
    number = int.from_bytes(buffer[start + 7 : start + 10], "little")
    kind = mavlink.mavlink_map.get(number)
    if kind is None:
        return False
    end = start + mavlink.HEADER_LEN_V2 + buffer[start + 1]
    found = int.from_bytes(buffer[end : end + _CRC_LENGTH], "little")
    checksum = mavlink.x25crc(buffer[start + 1 : end])
    checksum.accumulate(bytes([kind.crc_extra]))
    return bool(checksum.crc == found)

"""A stored mission, told to whoever asks."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.runtime.link.stored_mission import StoredMission
from twinscrew.runtime.link.wire import Message

MISSION = int(mavlink.MAV_MISSION_TYPE_MISSION)


def download(message: Message, mission: StoredMission, station: tuple[int, int]) -> Message:
    """Answer MISSION_REQUEST_LIST, MISSION_REQUEST or MISSION_REQUEST_INT."""
    kind = kind_of(message)
    if kind != MISSION:
        return acknowledgement(station, mavlink.MAV_MISSION_UNSUPPORTED, kind)
    if message.get_type() == "MISSION_REQUEST_LIST":
        return mavlink.MAVLink_mission_count_message(*station, len(mission.items))
    seq = message.seq
    if seq >= len(mission.items):
        return acknowledgement(station, mavlink.MAV_MISSION_INVALID_SEQUENCE)
    return mission.items[seq].message(station, seq, current=seq == mission.current)


def acknowledgement(station: tuple[int, int], result: int, kind: int = MISSION) -> Message:
    """Make MISSION_ACK."""
    return mavlink.MAVLink_mission_ack_message(*station, int(result), kind)


def kind_of(message: Message) -> int:
    """Give the MAV_MISSION_TYPE that a message is about."""
    return int(getattr(message, "mission_type", MISSION))

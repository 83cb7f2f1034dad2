from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.faults.ids import Impersonating
from twinscrew.hil_sim.faults.kinds import WrongIds
from twinscrew.runtime.link.ardupilot import commands
from twinscrew.runtime.mavlink import Wire


def sent() -> bytes:
    wire = Wire(1, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
    messages = (commands.heartbeat(), commands.thrust(1, (1600, 1400), "rc_override"))
    return b"".join(wire.encode(message) for message in messages)


def senders(settings: WrongIds) -> list[tuple[str, int, int]]:
    frames = b"".join(Impersonating(settings).put(sent(), 0.0))
    return [
        (m.get_type(), m.get_srcSystem(), m.get_srcComponent()) for m in Wire(9, 9).decode(frames)
    ]


def test_whole_frames_come_from_another_system() -> None:
    assert senders(WrongIds(system_id=99)) == [
        ("HEARTBEAT", 99, 191),
        ("RC_CHANNELS_OVERRIDE", 99, 191),
    ]


def test_whole_frames_come_from_another_component() -> None:
    assert {system_component[1:] for system_component in senders(WrongIds(component_id=7))} == {
        (1, 7)
    }

"""What an ArduPilot boat does, step by step: seen on ArduRover V4.6.0-dev, or read in its sources.

A step asserts; its docstring is its line in the table. They run in this order, against one
autopilot that has just been switched on without a receiver.
"""

from __future__ import annotations

from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.conformance.endpoints import SYSTEM
from tests.conformance.station import (
    ARM,
    HOLD,
    INTERVAL,
    MANUAL,
    REQUEST_MESSAGE,
    SET_MODE,
    SET_SERVO,
    Station,
    override,
)

from twinscrew.runtime.link.ardupilot.parameters import SHIPPED, read_parm

SERVO_OUTPUT_RAW, RC_CHANNELS, GPS_GLOBAL_ORIGIN = 36, 65, 49
FREE_SERVO = 5


def identity(station: Station) -> None:
    """Its heartbeat says: a surface boat of ArduPilot, component 1."""
    beat = station.next("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (11, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (SYSTEM, 1)


def arming(station: Station) -> None:
    """It refuses arming at first, with a reason, and does it later."""
    assert station.command(INTERVAL, SERVO_OUTPUT_RAW, 20_000) == 0
    station.heard.clear()
    assert station.command(ARM, 1) == 4
    station.outputs()
    texts = [m.text for m in station.heard if m.get_type() == "STATUSTEXT"]
    assert any(text.startswith(("Arm:", "PreArm:")) for text in texts), texts
    station.ready()
    beat = station.until(lambda m: m.get_type() == "HEARTBEAT" and m.base_mode & 128)
    assert beat.custom_mode == MANUAL


def rates(station: Station) -> None:
    """A message comes as often as SET_MESSAGE_INTERVAL asks."""
    assert station.command(INTERVAL, SERVO_OUTPUT_RAW, 100_000) == 0
    station.heard.clear()
    station.wait(5.0)
    count = sum(m.get_type() == "SERVO_OUTPUT_RAW" for m in station.heard)
    assert 40 <= count <= 60, f"{count} in 5 s at 10 Hz"


def parameters(station: Station) -> None:
    """Every parameter is as the shipped file sets it."""
    found = {name: station.parameter(name) for name in read_parm(SHIPPED)}
    wrong = {n: found[n] for n, v in read_parm(SHIPPED).items() if abs(found[n] - v) > 1e-5}
    assert not wrong


def writing(station: Station) -> None:
    """A parameter that is written is told back, and stays."""
    assert station.set_parameter("MOT_SLEWRATE", 50.0) == 50.0
    assert station.parameter("MOT_SLEWRATE") == 50.0
    assert station.set_parameter("MOT_SLEWRATE", 0.0) == 0.0


def one_to_one(station: Station) -> None:
    """Outputs 1 and 3 follow channels 1 and 3 one to one."""
    station.ready()
    for left in (1000, 1250, 1499, 1501, 1750, 2000):
        station.paddles = (left, 3000 - left)
        assert station.follows(left, 3000 - left), f"{left} us: {station.outputs()}"


def manual_control(station: Station) -> None:
    """MANUAL_CONTROL's y and z are the two paddles."""
    station.ready().streams = False
    for _ in range(20):
        station.send(mavlink.MAVLink_manual_control_message(SYSTEM, 0, 500, -500, 0, 0))
        station.step()
    message = station.next("SERVO_OUTPUT_RAW")
    assert abs(message.servo1_raw - 1750) <= 1
    assert abs(message.servo3_raw - 1250) <= 1


def stranger(station: Station) -> None:
    """Overrides of a system that is not SYSID_MYGCS are ignored without a word."""
    station.ready()
    station.heard.clear()
    for _ in range(25):
        station.send(override(1800, 1800), station.stranger)
        station.step()
    assert station.outputs(settle_s=0.0) == (1500, 1500)
    texts = [m.text for m in station.heard if m.get_type() == "STATUSTEXT"]
    assert not [text for text in texts if "verride" in text]


def set_servo(station: Station) -> None:
    """DO_SET_SERVO is refused on the propellers, and works on a free output even disarmed."""
    station.ready()
    for servo in (1, 3):
        assert station.command(SET_SERVO, servo, 1800) == 4
    assert station.outputs() == (1500, 1500)
    assert station.command(ARM, 0) == 0
    assert station.command(SET_SERVO, FREE_SERVO, 1777) == 0
    station.wait(0.3)
    assert station.next("SERVO_OUTPUT_RAW").servo5_raw == 1777


def silence(station: Station) -> None:
    """Without a receiver, overrides that stop: neutral after 0.6 s, HOLD after 2 s."""
    station.ready().paddles = (1700, 1700)
    station.outputs()
    assert station.command(INTERVAL, RC_CHANNELS, 100_000) == 0
    station.streams = False
    stopped_s = station.last_paddles_s
    station.until(lambda m: m.get_type() == "SERVO_OUTPUT_RAW" and m.servo1_raw == 1500)
    assert 0.45 <= station.now_s - stopped_s <= 0.8, f"{station.now_s - stopped_s:.2f} s"
    assert station.next("RC_CHANNELS").chan1_raw == 1700, "RC_CHANNELS shows the old override"
    station.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == HOLD)
    # the heartbeat may be up to one second late
    assert 1.9 <= station.now_s - stopped_s <= 3.2, f"{station.now_s - stopped_s:.2f} s"


def latching(station: Station) -> None:
    """HOLD latches: resumed overrides do nothing until MANUAL is commanded."""
    station.ready()
    station.streams = False
    station.until(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == HOLD)
    station.paddles, station.streams = (1700, 1700), True
    assert station.outputs(settle_s=3.0) == (1500, 1500)
    assert station.command(SET_MODE, 1, MANUAL) == 0
    assert station.follows(1700, 1700)


def runaway(station: Station) -> None:
    """With FS_THR_ENABLE 0 and no receiver the propellers run on for ever."""
    station.ready()
    assert station.set_parameter("FS_THR_ENABLE", 0.0) == 0.0
    station.paddles = (1600, 1600)
    assert station.follows(1600, 1600)
    station.streams = False
    station.wait(5.0)
    assert station.follows(1600, 1600)
    station.paddles, station.streams = (1500, 1500), True
    station.outputs()
    assert station.set_parameter("FS_THR_ENABLE", 1.0) == 1.0


def origin(station: Station) -> None:
    """Where its local frame begins is told when it is asked for."""
    station.ready()
    station.heard.clear()
    assert station.command(REQUEST_MESSAGE, GPS_GLOBAL_ORIGIN) == 0
    station.wait(1.0)
    origins = [m for m in station.heard if m.get_type() == "GPS_GLOBAL_ORIGIN"]
    assert origins
    assert origins[0].latitude != 0
    assert origins[0].longitude != 0


def timesync(station: Station) -> None:
    """TIMESYNC is answered with its own time, which moves on as ours does."""
    told = []
    for _ in range(2):
        question_ns = round(station.now_s * 1e9)
        station.send(mavlink.MAVLink_timesync_message(0, question_ns))
        answer = station.until(
            lambda m, asked=question_ns: m.get_type() == "TIMESYNC" and m.ts1 == asked and m.tc1
        )
        told.append((answer.tc1 * 1e-9, station.now_s))
        station.wait(2.0)
    (theirs, ours), (theirs_later, ours_later) = told
    assert abs((theirs_later - theirs) - (ours_later - ours)) < 0.3


def unknown_mode(station: Station) -> None:
    """An unknown mode is refused."""
    assert station.command(SET_MODE, 1, 99) != 0


def disarmed(station: Station) -> None:
    """Disarmed it gives no thrust."""
    station.ready().paddles = (1700, 1700)
    station.outputs()
    station.paddles = (1500, 1500)
    station.outputs()
    assert station.command(ARM, 0) == 0
    station.paddles = (1700, 1700)
    assert station.outputs() == (1500, 1500)


def routing(station: Station) -> None:
    """What a ground station has for the companion is handed on, and so is its answer."""
    station.ready()
    station.heard.clear()
    target = (SYSTEM, 191)
    station.send_from_ground(mavlink.MAVLink_mission_count_message(*target, 3))
    station.until(lambda m: m.get_type() == "MISSION_COUNT" and m.count == 3)
    station.heard_on_ground.clear()
    station.send(mavlink.MAVLink_mission_ack_message(255, 190, 14))
    station.send(mavlink.MAVLink_statustext_message(6, b"hello"))
    station.wait(0.5)
    on_ground = {m.get_type() for m in station.heard_on_ground if m.get_srcComponent() == 191}
    assert {"MISSION_ACK", "STATUSTEXT", "HEARTBEAT"} - on_ground <= {"HEARTBEAT"}, on_ground
    station.wait(1.5)
    beats = [m for m in station.heard_on_ground if m.get_type() == "HEARTBEAT"]
    assert {m.get_srcComponent() for m in beats} >= {1, 191}


def receiver(station: Station) -> None:
    """With a receiver, overrides that stop are held for RC_OVERRIDE_TIME, then the sticks rule."""
    assert station.set_parameter("SIM_RC_FAIL", 0.0) == 0.0
    station.ready().paddles = (1700, 1700)
    assert station.follows(1700, 1700)
    station.streams = False
    stopped_s = station.last_paddles_s
    station.until(lambda m: m.get_type() == "SERVO_OUTPUT_RAW" and m.servo1_raw == 1500)
    assert 2.8 <= station.now_s - stopped_s <= 3.4, f"{station.now_s - stopped_s:.2f} s"
    assert station.next("HEARTBEAT").custom_mode == MANUAL


def letting_go(station: Station) -> None:
    """With a receiver, a channel that is given back is the pilot's at once."""
    station.ready().paddles = (1700, 1700)
    assert station.follows(1700, 1700)
    station.streams = False
    for _ in range(5):
        station.send(override(0, 0))
        station.step()
    assert station.outputs() == (1500, 1500)


STEPS: tuple[Callable[[Station], None], ...] = (
    identity,
    arming,
    rates,
    parameters,
    writing,
    one_to_one,
    manual_control,
    stranger,
    set_servo,
    silence,
    latching,
    runaway,
    origin,
    timesync,
    unknown_mode,
    disarmed,
    routing,
    receiver,
    letting_go,
)
"""In this order: the last two switch the receiver on."""

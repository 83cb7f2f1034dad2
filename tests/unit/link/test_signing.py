import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.link.ardupilot.commands import heartbeat
from twinscrew.runtime.link.ardupilot.key_setup import KeySetup, Step
from twinscrew.runtime.mavlink import EPOCH_S, Signing, Wire, read_key

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
NOW_S = EPOCH_S + 3.6e8


class Clock:
    def __init__(self, now_s=NOW_S):
        self.now_s = now_s

    def __call__(self):
        return self.now_s


def end(key, clock=None, system=1):
    return Wire(system, 1, Signing(key, wall_clock=clock or Clock()))


def test_a_frame_signed_with_the_same_key_is_heard():
    assert len(end(KEY, system=2).decode(end(KEY).encode(heartbeat()))) == 1


def test_unsigned_and_wrongly_signed_frames_are_refused_and_counted():
    ear = end(KEY, system=2)
    assert ear.decode(Wire(1, 1).encode(heartbeat())) == []
    assert ear.decode(end(OTHER_KEY).encode(heartbeat())) == []
    assert ear.bad_frames >= 2


def test_a_mavlink_1_frame_is_refused_because_it_cannot_be_signed():
    ear, codec = end(KEY, system=2), Wire(1, 1)._codec
    assert ear.decode(heartbeat().pack(codec, force_mavlink1=True)) == []


def test_a_frame_heard_twice_counts_once():
    ear, frame = end(KEY, system=2), end(KEY).encode(heartbeat())
    assert len(ear.decode(frame)) == 1
    assert ear.decode(frame) == []


def test_an_old_recording_is_refused_by_an_ear_that_was_just_switched_on():
    clock = Clock()
    frame = end(KEY, clock).encode(heartbeat())
    late = Clock(NOW_S + 61.0)
    assert end(KEY, late, system=2).decode(frame) == []


def test_a_peer_that_restarts_is_heard_at_once():
    ear, clock = end(KEY, system=2), Clock()
    for _ in range(100):
        peer = end(KEY, clock)  # each time a new one, which knows no earlier timestamp
        assert len(ear.decode(peer.encode(heartbeat()))) == 1
        clock.now_s += 1.0


def test_a_forged_frame_from_the_future_does_not_shut_the_true_peer_out():
    ear, peer = end(KEY, system=2), end(KEY)
    assert len(ear.decode(peer.encode(heartbeat()))) == 1
    forger = end(OTHER_KEY, Clock(NOW_S + 1e6))
    assert ear.decode(forger.encode(heartbeat())) == []
    assert len(ear.decode(peer.encode(heartbeat()))) == 1


def test_timestamps_follow_the_wall_clock_and_never_go_back():
    clock = Clock()
    wire = end(KEY, clock)
    stamps = []
    for step_s in (0.0, 10.0, -100.0, 0.0):
        clock.now_s += step_s
        stamps.append(int.from_bytes(wire.encode(heartbeat())[-12:-6], "little"))
    assert stamps[0] == round((NOW_S - EPOCH_S) * 1e5)
    assert stamps == sorted(set(stamps))
    assert stamps[1] - stamps[0] == 1_000_000


@pytest.mark.parametrize("content", [KEY, KEY.hex().encode() + b"\n"])
def test_a_key_file_holds_bytes_or_hexadecimal_digits(tmp_path, content):
    path = tmp_path / "key"
    path.write_bytes(content)
    path.chmod(0o600)
    assert read_key(path) == KEY


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_key_that_others_may_use_is_refused(tmp_path, mode):
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(mode)
    with pytest.raises(ConfigError, match=r"chmod 600"):
        read_key(path)


@pytest.mark.parametrize("content", [b"", b"short", b"zz" * 32, KEY + b"\n", b"00" * 31])
def test_what_is_no_key_is_refused(tmp_path, content):
    path = tmp_path / "key"
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(ConfigError):
        read_key(path)


def test_a_missing_key_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match="nowhere"):
        read_key(tmp_path / "nowhere")


def pymavlink_end():
    """Make pymavlink's own codec with our key: another implementation of the same rules."""
    codec = mavlink.MAVLink(None, 1, 1)
    codec.robust_parsing = True
    codec.signing.secret_key = KEY
    codec.signing.sign_outgoing = True
    codec.signing.timestamp = round((NOW_S - EPOCH_S) * 1e5)
    return codec


def test_pymavlink_hears_what_we_sign():
    codec, wire = pymavlink_end(), end(KEY, system=2)
    for _ in range(3):
        (heard,) = codec.parse_buffer(wire.encode(heartbeat()))
        assert heard.get_type() == "HEARTBEAT"
    (refused,) = codec.parse_buffer(end(OTHER_KEY, system=3).encode(heartbeat()))
    assert refused.get_type() == "BAD_DATA"


def test_we_hear_what_pymavlink_signs():
    codec, ear = pymavlink_end(), end(KEY, system=2)
    assert [len(ear.decode(heartbeat().pack(codec))) for _ in range(3)] == [1, 1, 1]


def given(pilot, task, *, limit_s=15.0):
    """Let a key be put into a simulated autopilot; gives the seconds that it took."""
    now_s = 0.0
    while not task.over and now_s < limit_s:
        now_s = round(now_s + 0.05, 6)
        pilot.receive(task.go(pilot.step(now_s), now_s), now_s)
    return now_s


def setting_up(key=KEY, old=None):
    signing = [None if one is None else Signing(one, wall_clock=Clock()) for one in (key, old)]
    return KeySetup(signing[0], 1, 191, signing[1])


def pilot_with(key=None):
    return RoverAutopilot(
        RoverAutopilotSettings(),
        1,
        signing=None if key is None else Signing(key, wall_clock=Clock()),
    )


@pytest.fixture
def frozen_clock(monkeypatch):
    """The autopilot's own clock, too, shows NOW_S."""
    monkeypatch.setattr("twinscrew.runtime.mavlink.time.time", lambda: NOW_S)


@pytest.mark.usefixtures("frozen_clock")
@pytest.mark.parametrize("old", [None, OTHER_KEY])
def test_a_key_is_put_into_an_autopilot_and_counts_from_then_on(old):
    pilot, task = pilot_with(old), setting_up(old=old)
    given(pilot, task)
    assert task.step is Step.DONE
    assert pilot.wire.signs
    before = pilot.wire.bad_frames
    pilot.receive(Wire(1, 191).encode(heartbeat()), 20.0)
    assert pilot.wire.bad_frames == before + 1


@pytest.mark.usefixtures("frozen_clock")
def test_a_key_that_the_autopilot_has_is_not_sent_again():
    task = setting_up()
    assert given(pilot_with(KEY), task) < 2.0
    assert task.step is Step.HAS_IT


@pytest.mark.usefixtures("frozen_clock")
@pytest.mark.parametrize(
    ("has", "old", "why"),
    [
        (OTHER_KEY, None, "give it as --old-key"),
        (OTHER_KEY, bytes([7] * 32), "neither --key nor --old-key"),
        (None, OTHER_KEY, "does not sign: leave out --old-key"),
    ],
)
def test_who_signs_with_another_key_than_was_said_gets_none(has, old, why):
    pilot, task = pilot_with(has), setting_up(old=old)
    given(pilot, task)
    assert task.step is Step.REFUSED
    assert why in task.why


def test_an_armed_autopilot_gets_no_key_and_takes_none():
    pilot, task = pilot_with(), setting_up()
    pilot.rover.arm(force=True)
    given(pilot, task)
    assert "armed" in task.why
    setup = mavlink.MAVLink_setup_signing_message(1, 1, list(KEY), 1)
    pilot.receive(Wire(1, 191).encode(setup), 20.0)
    assert not pilot.wire.signs
    assert "Won't setup signing when armed" in pilot.rover.texts[-1]


def test_where_nobody_is_the_key_is_not_sent():
    task, sent = setting_up(), b""
    for k in range(400):
        sent += task.go(b"", k * 0.05)
    assert task.step is Step.REFUSED
    assert "no autopilot of system id 1" in task.why
    assert KEY not in sent


def test_a_key_that_was_lost_on_its_way_is_sent_once_only():
    pilot, task, sent = pilot_with(), setting_up(), []
    for k in range(400):
        said = task.go(pilot.step(k * 0.05), k * 0.05)
        sent += [said] if KEY in said else []
    assert len(sent) == 1
    assert "may have been lost" in task.why

"""MAVLink signing over real sockets: what comes without our key, or twice, is not heard.

A runtime's link on a UDP socket, a simulated autopilot that signs at the other end, and an attacker
who can send from the autopilot's own address and has heard everything that it said.
"""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from tests.harness.commands import twinscrew
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Mode
from twinscrew.hil_sim.autopilot.udp import AutopilotOnTheNet
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.link.transport import UdpTransport
from twinscrew.runtime.mavlink import Signing, Wire, read_key

STEP_S = 0.05
LOOPBACK = "127.0.0.1"


def key_file(folder: Path, name: str, key: bytes) -> str:
    path = folder / name
    path.write_bytes(key)
    path.chmod(0o600)
    return str(path)


class Sea:
    """A link and its autopilot, each on a socket, in steps of the link's time."""

    def __init__(self, folder: Path) -> None:
        self.key = key_file(folder, "key", bytes(range(32)))
        self.transport = UdpTransport(LOOPBACK, 0, listens=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((LOOPBACK, self.transport.port))
        self.settings = AutopilotSettings(
            arm=True, receiver_fitted=False, check_parameters=False, signing_key_file=self.key
        )
        self.now_s = 0.0
        self.heard: list[bytes] = []
        """Every datagram of the autopilot, as an eavesdropper has it."""
        self.start_link()
        self.start_autopilot()

    def start_link(self) -> None:
        self.link = AutopilotLink(self.settings)

    def start_autopilot(self, key: str | None = None) -> None:
        settings = RoverAutopilotSettings(signing_key_file=self.key if key is None else key)
        self.autopilot = RoverAutopilot(settings, 1, boot_s=self.now_s)

    def attack(self, datagram: bytes) -> None:
        """Send from the autopilot's own address."""
        self.socket.send(datagram)

    def step(self, *, autopilot: bool = True) -> None:
        self.now_s = round(self.now_s + STEP_S, 6)
        if autopilot:
            said = self.autopilot.step(self.now_s)
            if said:
                self.heard.append(said)
                self.socket.send(said)
        self.link.receive(self.transport.receive(), self.now_s)
        sent = self.link.command((400.0, 400.0), self.now_s) + self.link.tick(self.now_s)
        self.transport.send(sent)
        self.socket.setblocking(False)
        try:
            while True:
                self.autopilot.receive(self.socket.recv(65_536), self.now_s)
        except BlockingIOError:
            pass

    def sail(self, seconds: float, **how: bool) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step(**how)

    def reaches(self, look: Callable[[], bool]) -> None:
        """Step until something is so: datagrams take their time."""

        def goes() -> bool:
            self.step()
            return look()

        wait_until(goes)

    @property
    def bad(self) -> int:
        return self.link.status.bad_frames

    def takes(self, datagram: bytes) -> int:
        """How many of our counters move when a datagram arrives: messages heard, frames refused."""
        before = self.bad
        self.attack(datagram)
        wait_until(lambda: self.arrives(before))
        return self.bad - before

    def arrives(self, before: int) -> bool:
        data = self.transport.receive()
        if data:
            self.link.receive(data, self.now_s)
        return bool(data)

    def close(self) -> None:
        self.transport.close()
        self.socket.close()


@pytest.fixture
def sea(tmp_path: Path) -> Iterator[Sea]:
    sea = Sea(tmp_path)
    yield sea
    sea.close()


@pytest.fixture
def under_way(sea: Sea) -> Sea:
    sea.reaches(lambda: sea.autopilot.thrust_command_N().tolist() == [400.0, 400.0])
    assert sea.bad == 0
    return sea


def hold() -> mavlink.MAVLink_heartbeat_message:
    """A heartbeat that says: a pilot chose HOLD. Who believes it stops the boat."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_SURFACE_BOAT,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
        int(Mode.HOLD),
        mavlink.MAV_STATE_ACTIVE,
        3,
    )


def forged(tmp_path: Path, kind: str) -> bytes:
    if kind == "unsigned":
        return Wire(1, 1).encode(hold())
    if kind == "MAVLink 1":
        return bytes(hold().pack(mavlink.MAVLink(None, 1, 1), force_mavlink1=True))
    wrong = key_file(tmp_path, "wrong", bytes(32))
    thief = RoverAutopilot(RoverAutopilotSettings(signing_key_file=wrong), 1)
    return thief.wire.encode(hold())


@pytest.mark.parametrize("kind", ["unsigned", "MAVLink 1", "wrong key"])
def test_a_forged_heartbeat_is_refused_and_the_boat_goes_on(
    under_way: Sea, tmp_path: Path, kind: str
) -> None:
    refused = under_way.takes(forged(tmp_path, kind))
    assert refused >= 1 or under_way.link.status.old_frames >= 1
    assert under_way.link.status.mode == "MANUAL"
    under_way.sail(2.0)
    assert under_way.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


def test_the_same_heartbeat_signed_with_our_key_would_have_stopped_it(under_way: Sea) -> None:
    """The comparison that shows that the tests here can fail."""
    assert under_way.takes(under_way.autopilot.wire.encode(hold())) == 0
    assert under_way.link.status.mode == "HOLD"


def test_everything_that_the_autopilot_ever_said_said_again_is_refused(under_way: Sea) -> None:
    under_way.sail(1.0)
    age_s = under_way.link.status.message_age_s
    for datagram in list(under_way.heard):
        assert under_way.takes(datagram) >= 1
    under_way.now_s += 10.0
    under_way.link.receive(b"", under_way.now_s)
    under_way.link.tick(under_way.now_s)
    assert under_way.link.status.message_age_s >= age_s + 10.0  # no sign of life


def test_a_replay_of_an_hour_ago_is_refused_by_a_link_that_was_just_started(under_way: Sea) -> None:
    later = Signing(read_key(Path(under_way.key)), wall_clock=lambda: time.time() + 3600.0)
    under_way.link = AutopilotLink(under_way.settings, signing=later)
    for datagram in list(under_way.heard):
        assert under_way.takes(datagram) >= 1
    assert not under_way.link.status.connected


def test_an_autopilot_that_starts_again_is_heard_again_at_once(under_way: Sea) -> None:
    """Its signing clock starts from the wall clock, past all that it said before."""
    for _ in range(3):
        under_way.start_autopilot()
        under_way.reaches(lambda: not under_way.link.status.armed)
        assert under_way.bad == 0
        under_way.link.ask_again()
        under_way.reaches(lambda: under_way.autopilot.thrust_command_N().any())


def test_a_runtime_that_starts_again_is_obeyed_again_at_once(under_way: Sea) -> None:
    for _ in range(3):
        under_way.start_link()
        under_way.reaches(lambda: under_way.link.status.engaged)
        under_way.reaches(lambda: under_way.autopilot.thrust_command_N().any())
        assert under_way.autopilot.wire.bad_frames == 0


@pytest.mark.parametrize("theirs", ["wrong key", "no key"])
def test_an_autopilot_without_our_key_is_never_heard(sea: Sea, tmp_path: Path, theirs: str) -> None:
    sea.start_autopilot(key_file(tmp_path, "w", bytes(32)) if theirs == "wrong key" else "")
    sea.reaches(lambda: sea.bad > 3)
    assert not sea.link.status.connected
    assert not sea.autopilot.rover.armed


@pytest.mark.parametrize("size", [300, 1500, 60_000])
def test_datagrams_larger_than_any_message_are_refused_and_what_follows_is_heard(
    under_way: Sea, size: int
) -> None:
    for filler in (b"\xfd", b"\xff", b"\x00"):
        under_way.attack(filler * size)
        under_way.sail(0.5)
    assert len(under_way.link.wire._buffer) < 300
    under_way.reaches(lambda: under_way.autopilot.thrust_command_N().tolist() == [400.0, 400.0])
    assert under_way.link.status.connected


def test_a_frame_that_claims_more_than_it_has_is_refused(under_way: Sea) -> None:
    frame = bytearray(under_way.autopilot.wire.encode(hold()))
    frame[1] = 255  # its payload would reach beyond the datagram
    under_way.attack(bytes(frame))
    under_way.sail(3.0)
    assert under_way.link.status.mode == "MANUAL"
    assert under_way.autopilot.thrust_command_N().tolist() == [400.0, 400.0]


class OnTheNet(threading.Thread):
    """A simulated autopilot behind a UDP port, in real time."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.line = UdpTransport(LOOPBACK, 0, listens=True)
        self.pilot = RoverAutopilot(RoverAutopilotSettings(), 1)
        self.over = threading.Event()

    def run(self) -> None:
        net = AutopilotOnTheNet(self.pilot, self.line)
        begin_s = time.monotonic()
        while not self.over.wait(0.02):
            net.step(time.monotonic() - begin_s, None)
        net.close()


@pytest.fixture
def on_the_net() -> Iterator[OnTheNet]:
    thread = OnTheNet()
    thread.start()
    yield thread
    thread.over.set()
    thread.join()


def test_a_key_is_made_and_put_into_an_autopilot_by_two_commands(on_the_net, tmp_path) -> None:
    key, connection = tmp_path / "mavlink.key", f"udpout:{LOOPBACK}:{on_the_net.line.port}"
    words = ("signing", "setup", "--key", key, "--connection", connection)
    assert twinscrew("signing", "make", key).returncode == 0
    assert key.stat().st_mode & 0o777 == 0o600
    assert twinscrew("signing", "make", key).returncode == 2  # it is there: nothing is written over
    asked = twinscrew(*words)
    assert asked.returncode != 0
    assert f"in the clear over {connection}" in asked.stdout + asked.stderr
    assert not on_the_net.pilot.wire.signs
    done = twinscrew(*words, "--yes")
    assert (done.returncode, done.stdout) == (0, "the autopilot signs with the key\n"), done.stderr
    assert on_the_net.pilot.wire.signs
    again = twinscrew(*words, "--yes")
    assert again.stdout == "the autopilot has this key already\n"
    other = tmp_path / "other.key"
    twinscrew("signing", "make", other)
    refused = twinscrew(*words[:3], other, *words[4:], "--yes")
    assert refused.returncode == 2
    assert "signs already, with another key: give it as --old-key" in refused.stderr

"""Fuzzes a whole boat with messages made by a grammar: `messages.py SECONDS [SEED]`.

Bits turned at random seldom make a message that is read to its end. These are well-formed but for
what the grammar changes: how many fields, how long names, which stamps, numbers and counts, and
which frames on the MAVLink line. A boat in simulated time (the real loop, its vessel, publisher,
ground report and a simulated autopilot) takes them in. Nothing may raise, be it caught
(`internal_error`), and nothing may take more work, in calls, than the greatest sensible message.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

sys.path.insert(0, ".")
from tests.harness.boat import Boat, cloud, odometry
from tests.harness.work import calls_of

from twinscrew.runtime.bus.base import MemoryBus, Received
from twinscrew.runtime.datum import Datum
from twinscrew.runtime.ground.report import GroundReport, GroundSettings
from twinscrew.runtime.link.transport import Transport
from twinscrew.runtime.mavlink import Wire
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.navigation import write_header
from twinscrew.runtime.messages.types import Goal
from twinscrew.runtime.messages.wire import Writer
from twinscrew.runtime.vessel.outputs import Publisher
from twinscrew.runtime.vessel.realtime import Loop

MOST_CALLS = 150_000
"""[-] Of one message: the longest route whose places are in frames of their own takes 119 000."""
CASES_A_BOAT = 40
STAMPS = (0, 1, -1, 2**31 - 1, -(2**31), 1_800_000_000)
"""[s] The ends of what a stamp can hold, and the harness's day."""
SIZES = (0, 1, 2, 3, 63, 64, 65, 254, 255, 256, 4095, 4096, 4097, 65_536)
"""[-] Counts and lengths: about every limit."""
FAULTS: list[str] = []
"""What the runtime said of exceptions within it."""
NUMBERS = (0.0, -1.0, 1e-300, 1e7, 9.9e7, 1e8, 4e7, 1e9, 1e300, np.inf, np.nan)


class Line(Transport):
    """The autopilot's line, on which somebody else may speak, too."""

    def __init__(self, boat: Boat) -> None:
        self.boat, self.also = boat, b""

    def fileno(self) -> int:
        return -1

    def receive(self) -> bytes:
        also, self.also = self.also, b""
        return self.boat.autopilot.step(self.boat.now_s) + also

    def send(self, data: bytes) -> None:
        self.boat.autopilot.receive(data, self.boat.now_s)

    def close(self) -> None: ...


class Grammar:
    """Makes messages of every input, odd in one place or in many."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def message(self, time_s: float) -> tuple[str, bytes]:
        makers = {
            "points": self.cloud,
            "odometry": self.odometry,
            "goal": self.goal,
            "route": self.route,
        }
        topic = str(self.rng.choice([*makers, "points"]))
        payload = bytearray(makers[topic](time_s))
        for _ in range(int(self.rng.integers(0, 4)) * self.one_in(3)):
            payload[int(self.rng.integers(0, len(payload)))] = int(self.rng.integers(0, 256))
        if self.one_in(10):
            del payload[int(self.rng.integers(0, len(payload))) :]
        return topic, bytes(payload)

    def one_in(self, count: int) -> bool:
        return bool(self.rng.integers(0, count) == 0)

    def size(self) -> int:
        return int(self.rng.choice(SIZES)) if self.one_in(3) else int(self.rng.integers(0, 12))

    def name(self) -> str:
        letter = str(self.rng.choice(["x", "é", "\x7f", "[", "%", "\n"]))
        common = str(self.rng.choice(["x", "y", "z", "t", "ring", "lidar"]))
        return letter * self.size() if self.one_in(3) else common

    def number(self) -> float:
        return float(self.rng.choice(NUMBERS)) if self.one_in(3) else float(self.rng.normal(0, 50))

    def stamp_ns(self, time_s: float) -> int:
        if self.one_in(2):
            time_s += float(self.rng.choice([-10.0, -0.2, 0.0, 0.0, 0.3, 3600.0]))
            return odometry(time_s).stamp_ns
        return int(self.rng.choice(STAMPS)) * 10**9 + int(self.rng.integers(0, 10**9))

    def header(self, writer: Writer, time_s: float) -> None:
        seconds, rest = divmod(self.stamp_ns(time_s), 10**9)
        writer.values("iI", 4, seconds, rest if not self.one_in(20) else 2**32 - 1)
        writer.string(self.name())

    def cloud(self, time_s: float) -> bytes:
        if self.one_in(3):
            points = self.rng.normal(0, 10, (self.size(), 3))
            return cdr.encode_point_cloud(
                replace(cloud(time_s, points), stamp_ns=self.stamp_ns(time_s))
            )
        writer = Writer()
        self.header(writer, time_s)
        width, step = self.size() % 5000, int(self.rng.choice([0, 4, 12, 16, 32]))
        writer.values("2I", 4, 1, width)
        fields = int(self.rng.choice(SIZES)) if self.one_in(3) else int(self.rng.integers(0, 12))
        names = [self.name()] * fields
        names += [*"xyz"] * bool(self.rng.integers(0, 2))
        writer.values("I", 4, len(names) if not self.one_in(9) else self.size())
        for name in names:
            writer.string(name)
            writer.values("IB3xI", 4, self.size() % 40, int(self.rng.integers(0, 10)), 1)
        writer.values("?3x2I", 4, self.one_in(4), step, width * step)
        writer.octets(self.rng.bytes(width * step))
        writer.values("?", 1, True)
        return writer.payload()

    def odometry(self, time_s: float) -> bytes:
        made = odometry(time_s, self.number(), self.number())
        made = replace(made, stamp_ns=self.stamp_ns(time_s))
        return cdr.encode_odometry(made, frame_id=self.name(), child_frame_id=self.name())

    def goal(self, time_s: float) -> bytes:
        place = np.array([self.number(), self.number()])
        goal = Goal(stamp_ns=self.stamp_ns(time_s), position_N=place)
        return cdr.encode_goal(goal, frame_id=self.name())

    def route(self, time_s: float) -> bytes:
        count, alike = self.size() % 5000, self.one_in(2)
        if alike:
            places = self.rng.normal(0, 50, (count, 2))
            return cdr.encode_path(
                places, stamp_ns=self.stamp_ns(time_s), frame_id=self.name()[:300]
            )
        writer = Writer()
        self.header(writer, time_s)
        writer.values("I", 4, count)
        for place in range(count):
            write_header(writer, 0, "a" * (place % 3))
            writer.values("7d", 8, *self.rng.normal(0, 50, 7))
        return writer.payload()

    def frames(self) -> bytes:
        """Give MAVLink frames of anybody's, whole or not."""
        wire = Wire(int(self.rng.choice([1, 1, 1, 255])), int(self.rng.choice([1, 1, 190])))
        kinds = list(mavlink.mavlink_map.values())
        data = b""
        for _ in range(self.size() % 300):
            kind = kinds[int(self.rng.integers(0, len(kinds)))]
            number = kind.id
            body = self.rng.bytes(int(self.rng.integers(0, 256)))
            head = bytes([len(body), 0, 0, 0, wire.system_id, 1]) + number.to_bytes(3, "little")
            checksum = mavlink.x25crc(bytearray(head + body))
            checksum.accumulate(bytes([kind.crc_extra]))
            data += b"\xfd" + head + body + checksum.crc.to_bytes(2, "little")
        if self.one_in(3):
            data += b"\xfd\xff\x00" * self.size()
        return data


def refuse_faults(payload: bytes) -> None:
    """Take an exception that the runtime caught for what it is."""
    events = cdr.decode_diagnostics(payload)
    FAULTS.extend(event.detail for event in events if event.name == "internal_error")


def sail(rng: np.random.Generator) -> int:
    """Let one boat take in some tens of odd messages; give the most calls that one took."""
    datum = Datum(latitude_deg=59.0, longitude_deg=11.0)
    report = GroundReport(GroundSettings(vessels_hz=5.0, obstacles_hz=5.0), datum, 1)
    boat, grammar = Boat(report=report), Grammar(rng)
    line = Line(boat)
    bus = MemoryBus("wamv")
    bus.subscribe("diagnostics", lambda message: refuse_faults(message.payload))
    loop = Loop(
        boat.vessel,
        None,  # type: ignore[arg-type]  # messages are handed over here
        line,
        Publisher(bus, None),
        rate_hz=20.0,
        clock=lambda: boat.now_s,
    )
    loop._next_tick_s = 0.0
    boat.sail(3.0)
    most = 0
    for _ in range(CASES_A_BOAT):
        topic, payload = grammar.message(boat.now_s)
        received = Received(topic, payload, time.monotonic_ns())
        most = max(most, calls_of(lambda received=received: loop._compute(received)))
        if grammar.one_in(3):
            line.also = grammar.frames()
        if grammar.one_in(2):
            boat.sail(0.1)
        most = max(most, calls_of(loop._tick))
        boat.now_s += 0.05
    return most


def main() -> None:
    seconds = float(sys.argv[1])
    first = int(sys.argv[2]) if len(sys.argv) > 2 else time.time_ns() % 2**32
    until_s, seed, most = time.monotonic() + seconds, first, 0
    while time.monotonic() < until_s:
        try:
            most = max(most, sail(np.random.default_rng(seed)))
            assert most < MOST_CALLS, f"{most} calls for one message"
            assert not FAULTS, FAULTS
        except BaseException:
            print(f"messages: seed {seed} breaks it: python tests/fuzz/messages.py 1 {seed}")
            raise
        seed += 1
    cases = (seed - first) * CASES_A_BOAT
    print(f"messages: clean, {cases} messages from seed {first}, at most {most} calls for one")


if __name__ == "__main__":
    main()

"""A stand-in for ArduRover's simulator, as its JSON physics and its MAVLink see it from outside.

    python -m tests.harness.ardupilot_peer --model JSON:127.0.0.1 --instance 0 --defaults FILE

Ports, order of events and the physics protocol are those that were measured on ArduRover V4.6.0-dev
(lock-step, UDP 9002 + 10 N), or read in its sources: TCP 5760 + 10 N waited for at the start, the
text search that it calls a parser, a frame asked for again after a second, position counted from
where it was switched on. Behind them is our own simulated autopilot. What it lacks: ArduPilot's
filters.
"""

from __future__ import annotations

import argparse
import math
import re
import select
import socket
import sys
from pathlib import Path

import numpy as np

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.parameters import Parameters
from twinscrew.hil_sim.autopilot.rover import RoverSettings
from twinscrew.hil_sim.autopilot.telemetry import Origin
from twinscrew.hil_sim.bridges.ardupilot_json import ServoFrame, encode_servos
from twinscrew.runtime.geometry import rotation_from_quaternion
from twinscrew.runtime.link.ardupilot.parameters import read_parm
from twinscrew.runtime.messages.types import Odometry

AGAIN_S = 1.0
MEMORY = Path("eeprom.bin")
LONGEST_S = 0.1
EARTH_RADIUS_M = 6_378_100.0
"""[m] ArduPilot's earth."""


class Sensors:
    """What came in one line, found as ArduPilot finds it: by text search, floats in single."""

    def __init__(self, line: str) -> None:
        self.time_s = float(re.match(r"[-+.e\d]+", after(line, "timestamp"))[0])
        self.gyro = triple(after(line[line.index("imu") :], "gyro"))
        self.accel = triple(after(line[line.index("imu") :], "accel_body"))
        self.position = triple(after(line, "position"))
        self.quaternion = numbers(after(line, "quaternion"), 4)
        self.velocity = triple(after(line, "velocity"))


def after(line: str, key: str) -> str:
    """Give the text behind a key, its quotation mark and its colon: no space may be there."""
    return line[line.index(key) + len(key) + 2 :]


def triple(text: str) -> np.ndarray:
    return numbers(text, 3)


def numbers(text: str, count: int) -> np.ndarray:
    assert text[0] == "[", f"ArduPilot would not understand {text[:40]!r}"
    values = text[1 : text.index("]")].split(",")
    assert len(values) == count
    return np.array([np.float32(value) for value in values], dtype=np.float64)


def whole_line(buffer: bytes) -> str:
    """Give the last line that has a newline before and after it."""
    lines = buffer.split(b"\n")
    assert len(lines) >= 3, "a newline must stand before and after the line"
    return lines[-2].decode("ascii")


class Peer:
    """One simulated autopilot between two sockets."""

    pilot: RoverAutopilot | None = None

    def __init__(
        self,
        instance: int,
        parameters: Path,
        wrong: dict[str, float],
        home: str,
        rate_hz: int,
        arming_s: float,
    ) -> None:
        values = read_parm(parameters) | wrong | (read_parm(MEMORY) if MEMORY.exists() else {})
        system_id = int(values["SYSID_THISMAV"])
        known = Parameters(system_id, {})
        changes = {n: v for n, v in values.items() if math.isfinite(known.get(n, math.nan))}
        self.rate_hz = rate_hz
        self.count = self.changes = 0
        self.time_s = 0.0
        self.told_s = 0.0
        self.asked_again = 0
        """[-] Frames that were asked for twice, as the answer took long."""
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.connect(("127.0.0.1", 9002 + 10 * instance))
        with socket.create_server(("127.0.0.1", 5760 + 10 * instance)) as server:
            self.tcp, _ = server.accept()  # SERIAL0 is tcp:0:wait
        self.tcp.setblocking(False)
        self.begin = self.pass_time().position
        rover = RoverSettings(arming_delay_s=arming_s, parameters=changes, calibrated=False)
        settings = RoverAutopilotSettings(rover=rover)
        self.pilot = RoverAutopilot(settings, system_id, place_of(home, self.begin))

    def frame(self) -> None:
        """Let the time of a frame pass, and the autopilot do what it does in it."""
        sensors = self.pass_time()
        self.pilot.receive(self.heard(), self.time_s)
        self.remember(self.pilot.rover.parameters)
        answer = self.pilot.step(self.time_s, self.odometry(sensors))
        if answer:
            self.tcp.send(answer)

    def remember(self, parameters: Parameters) -> None:
        """Keep what was written, as the real one does in its eeprom.bin."""
        if parameters.changes != self.changes:
            self.changes = parameters.changes
            lines = [f"{name} {parameters[name]:g}\n" for name in parameters.written]
            MEMORY.write_text("".join(lines))

    def pass_time(self) -> Sensors:
        """Ask for a frame, wait for its answer, let the time pass that it tells."""
        sensors = self.ask()
        dt_s = sensors.time_s - self.told_s
        self.told_s = sensors.time_s
        self.count += 1
        assert 0.0 < dt_s < LONGEST_S, f"ArduPilot would not move on by {dt_s} s"
        self.time_s += dt_s
        return sensors

    def ask(self) -> Sensors:
        outputs = tuple(self.pilot.rover.servo_outputs()) if self.pilot else (1500,) * 16
        request = encode_servos(ServoFrame(self.rate_hz, self.count, outputs))
        send = True
        while True:
            try:
                if send:
                    self.udp.send(request)
                send = not select.select([self.udp], [], [], AGAIN_S)[0]
                if send:
                    self.asked_again += 1
                    continue
                sensors = Sensors(whole_line(self.udp.recv(65_000)))
                if sensors.time_s > self.told_s or not self.asked_again:
                    return sensors
                self.asked_again -= 1  # the second answer to a frame that was asked for twice
            except ConnectionRefusedError:
                send = True
                select.select([], [], [], 0.1)  # the physics is not there yet, or gone

    def heard(self) -> bytes:
        try:
            data = self.tcp.recv(65_536)
        except BlockingIOError:
            return b""
        if not data:
            raise SystemExit("the companion closed its connection")
        return data

    def odometry(self, sensors: Sensors) -> Odometry:
        return Odometry(
            stamp_ns=round(self.time_s * 1e9),
            position_N=sensors.position - self.begin,
            q_NB=sensors.quaternion,
            velocity_B=rotation_from_quaternion(sensors.quaternion).T @ sensors.velocity,
            rates_B=sensors.gyro,
        )


def place_of(home: str, position: np.ndarray) -> Origin:
    """Give the place on the earth of a position from `--home`: a filter begins where it is."""
    latitude, longitude, altitude, _ = (float(word) for word in home.split(","))
    north_deg, east_deg = np.degrees(position[:2] / EARTH_RADIUS_M)
    parallel = math.cos(math.radians(latitude + north_deg / 2))
    return Origin(
        latitude_deg=latitude + north_deg,
        longitude_deg=longitude + east_deg / parallel,
        altitude_m=altitude,
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    for word in ("--model", "--home", "--speedup", "--sysid", "--serial1"):
        parser.add_argument(word)
    parser.add_argument("--wipe", action="store_true")
    parser.add_argument("--instance", type=int, default=0)
    parser.add_argument("--defaults", type=Path, required=True)
    parser.add_argument("--rate", type=int, default=200)
    parser.add_argument("--arming-delay", type=float, default=1.0)
    given = sys.argv[1:]
    if "--home" in given:  # its value begins with a minus, which argparse takes for an option
        at = given.index("--home")
        given[at : at + 2] = [f"--home={given[at + 1]}"]
    parser.add_argument("--wrong", action="append", default=[], help="NAME=VALUE")
    words = parser.parse_args(given)
    if words.wipe:
        MEMORY.unlink(missing_ok=True)
    wrong = {name: float(value) for name, value in (word.split("=") for word in words.wrong)}
    assert words.model == "JSON:127.0.0.1"
    peer = Peer(words.instance, words.defaults, wrong, words.home, words.rate, words.arming_delay)
    print(f"instance {words.instance}: a companion is here", flush=True)
    while True:
        try:
            peer.frame()
        except (BrokenPipeError, ConnectionResetError):
            sys.exit("the companion is gone")


if __name__ == "__main__":
    main()

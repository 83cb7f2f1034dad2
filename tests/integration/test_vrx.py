"""VRX as docs/ros2.md tells it: its steps, and what stops thrusters that take newtons by topic."""

from __future__ import annotations

import json
import re
import shlex
import signal
import textwrap
import threading
import time
import tomllib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
import tomli_w
import zenoh
from tests.docs.commands import ROOT, commands_of
from tests.harness.boat import cloud, odometry
from tests.harness.commands import running, stop, twinscrew
from tests.harness.waiting import wait_until

from twinscrew.hil_sim.drivers.processes import LOOPBACK, free_port
from twinscrew.runtime.bus.base import Received, attachment
from twinscrew.runtime.bus.zenoh import ZenohBus, ZenohSettings
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.topics import TOPICS, key, type_store
from twinscrew.runtime.recording.recording import find_recordings

pytestmark = pytest.mark.slow
PAGE = ROOT / "docs" / "ros2.md"
STEPS = ("sitl", "doctor", "run", "goal", "enable")


def steps() -> dict[str, list[str]]:
    """Give the words of the page's commands, by what they do."""
    found = {}
    for command in commands_of(PAGE):
        words = shlex.split(command.words)
        if command.is_shown and words[0] == "twinscrew" and "--zenoh-" not in command.words:
            name = words[2] if words[1] == "send" else words[1]
            if name in STEPS:
                found.setdefault(name, words[1:])
    return found


def boats_file(folder: Path, port: int, key_format: str, *, senses: bool) -> Path:
    """Write the page's boat.toml, with another port and key format; `senses`: by GPS and IMU."""
    blocks = re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    boat, gps_imu = (tomllib.loads(textwrap.dedent(block)) for block in blocks[:2])
    boat |= gps_imu if senses else {}
    endpoints = [endpoint.replace("7447", str(port)) for endpoint in boat["bus"]["connect"]]
    boat["bus"] = {"connect": endpoints, "key_format": key_format}
    boat["recording"] = {"folder": str(folder / "kept")}
    (folder / "boat.toml").write_text(tomli_w.dumps(boat))
    return folder / "boat.toml"


@pytest.mark.parametrize(("key_format", "senses"), [("ros2dds", False), ("rmw_zenoh", True)])
def test_the_documented_steps_sail_the_boat_to_its_goal(
    tmp_path: Path, key_format: str, senses: bool
) -> None:
    done, port = steps(), free_port()
    assert tuple(done) == STEPS
    boat = boats_file(tmp_path, port, key_format, senses=senses)

    def words(step: str) -> list[str]:
        return [str(boat) if word == "boat.toml" else word for word in done[step]]

    ours = ["--zenoh-port", str(port), "--key-format", key_format, "--out", str(tmp_path / "sim")]
    log, told = tmp_path / "sim.txt", tmp_path / "run.txt"
    with running(*words("sitl"), *ours, "--json", log=log) as simulator:
        wait_until(lambda: "waits for thrust" in log.read_text())
        heard = twinscrew(*words("doctor"), "--json")
        rows = {row["what"]: row["verdict"] for row in json.loads(heard.stdout)["checks"]}
        inputs = ("points", "gps", "imu") if senses else ("points", "odometry")
        assert {rows[name] for name in inputs} == {"OK"}, heard.stdout
        with running(*words("run"), log=told) as runtime:
            wait_until(lambda: "wamv: running" in told.read_text())
            assert twinscrew(*words("goal")).returncode == 0
            with running(*words("enable"), log=tmp_path / "enable.txt") as operator:
                assert simulator.wait(200) == 0, log.read_text()
                assert stop(operator, signal.SIGINT) == 0
            assert stop(runtime) == 0, told.read_text()
    (vessel,) = json.loads((tmp_path / "sim" / "summary.json").read_text())["vessels"]
    assert (vessel["name"], vessel["outcome"]) == ("wamv", "goal")
    assert events(tmp_path / "kept").index("thrust_enabled") < events(tmp_path / "kept").index(
        "goal_reached"
    )
    assert frames(tmp_path / "kept") == {
        ("map", "wamv/base_link"),
        ("wamv/base_link", "wamv/wamv/base_link/lidar_wamv_sensor"),
    }


def events(folder: Path) -> list[str]:
    (recording,) = find_recordings(folder)
    payloads = [m.payload for m in recording.messages() if m.topic == "diagnostics"]
    return [event.name for payload in payloads for event in cdr.decode_diagnostics(payload)]


def frames(folder: Path) -> set[tuple[str, str]]:
    (recording,) = find_recordings(folder)
    store, found = type_store(), set()
    for message in recording.messages(("transforms", "static_transforms")):
        read = store.deserialize_cdr(message.payload, TOPICS[message.topic].ros_type)
        found |= {(t.header.frame_id, t.child_frame_id) for t in read.transforms}
    return found


# -- What stops the thrusters.


class Deck:
    """Sensors, thrusters and an operator of one boat, in threads."""

    def __init__(self, bus: ZenohBus) -> None:
        self._bus = bus
        self.measures, self.enables = True, True
        self.came: list[tuple[float, float]] = []
        """[s], [N] When a thrust of the left propeller came, and how much."""
        self._stop = threading.Event()
        bus.subscribe("thrust_left", self._take)
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _take(self, message: Received) -> None:
        self.came.append((time.monotonic(), cdr.decode_thrust(message.payload)))

    def _work(self) -> None:
        step, begin_s = 0, time.monotonic()
        while not self._stop.is_set():
            now_s = step * 0.05
            if self.measures:
                self._bus.publish("odometry", cdr.encode_odometry(odometry(now_s)))
                if step % 2 == 0:
                    self._bus.publish("points", cdr.encode_point_cloud(cloud(now_s)))
            if self.enables and step % 4 == 0:
                self._bus.publish("enable", cdr.encode_enable(True))
            step += 1
            time.sleep(max(0.0, begin_s + step * 0.05 - time.monotonic()))

    def drives(self) -> bool:
        """Tell whether the newest thrust turns the propeller."""
        return bool(self.came) and self.came[-1][1] != 0.0

    def neutral_after(self, act_s: float, for_s: float = 0.0) -> float:
        """Wait for zeros that go on for a while; give how long after a time they began [s]."""

        def rests() -> float | None:
            came = list(self.came)
            turns_s = max((t for t, thrust in came if thrust != 0.0), default=act_s)
            zeros = [t for t, thrust in came if thrust == 0.0 and t > turns_s]
            return zeros[0] if zeros and zeros[-1] - zeros[0] >= for_s else None

        return wait_until(rests) - act_s

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


@contextmanager
def sailing(folder: Path, options: str = "") -> Iterator[tuple[Deck, object, ZenohBus, Path]]:
    """Have a runtime drive thrusters by topic."""
    endpoint, log = f"tcp/{LOOPBACK}:{free_port()}", folder / "log.txt"
    config = folder / "boat.toml"
    config.write_text(
        'name = "wamv"\nsensor = "vrx16"\npolicy = "apf"\n'
        "[mission]\nwaypoints_m = [[100.0, 0.0]]\n"
        f'[autopilot]\nkind = "thrust"\n{options}[bus]\nconnect = ["{endpoint}"]\n'
        f'[recording]\nfolder = "{folder / "kept"}"\n'
    )
    settings = ZenohSettings(listen=(endpoint,), connect=(), node="")
    with (
        closing(ZenohBus(settings, "wamv")) as bus,
        closing(Deck(bus)) as deck,
        running("run", "--config", config, "--arm", log=log) as runtime,
    ):
        wait_until(deck.drives)
        time.sleep(1.0)
        yield deck, runtime, bus, log


def test_what_ends_the_driving_ends_the_thrust_in_time_and_the_boat_goes_on_after_it(
    tmp_path: Path,
) -> None:
    with sailing(tmp_path) as (deck, runtime, bus, _):
        deck.measures, act_s = False, time.monotonic()
        assert deck.neutral_after(act_s, for_s=0.5) < 0.5
        deck.measures = True
        wait_until(deck.drives)

        deck.enables, act_s = False, time.monotonic()
        assert deck.neutral_after(act_s, for_s=0.5) < 1.3
        deck.enables = True
        wait_until(deck.drives)

        act_s = time.monotonic()
        bus.publish("enable", cdr.encode_enable(False))
        assert deck.neutral_after(act_s, for_s=1.5) < 0.2  # though the enables go on
        deck.enables = False
        time.sleep(1.2)
        deck.enables = True
        wait_until(deck.drives)

        act_s = time.monotonic()
        assert stop(runtime) == 0
        assert deck.neutral_after(act_s, for_s=1.0) < 0.5  # and goes on after its end
    names = events(tmp_path / "kept")
    for name in ("odometry_stale", "enable_lost", "thrust_disabled"):
        assert name in names


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_runtime_that_cannot_stop_the_thrusters_any_more_has_them_stopped(
    tmp_path: Path, number: signal.Signals
) -> None:
    with sailing(tmp_path) as (deck, runtime, _, _):
        act_s = time.monotonic()
        runtime.send_signal(number)
        assert deck.neutral_after(act_s, for_s=1.0) < 0.7
        if number is signal.SIGSTOP:
            runtime.send_signal(signal.SIGCONT)
            wait_until(deck.drives)


def test_without_consent_nothing_drives_and_the_events_say_why(tmp_path: Path) -> None:
    with sailing(tmp_path, "") as (deck, runtime, _, _):
        assert stop(runtime) == 0
    config, log = tmp_path / "boat.toml", tmp_path / "again.txt"
    endpoint = re.search(r'connect = \["(.*?)"\]', config.read_text())[1]
    settings = ZenohSettings(listen=(endpoint,), connect=(), node="")
    with (
        closing(ZenohBus(settings, "wamv")) as bus,
        closing(Deck(bus)) as deck,
        running("run", "--config", config, log=log) as runtime,
    ):
        wait_until(lambda: len(deck.came) > 60)
        assert not any(thrust for _, thrust in deck.came)
        assert stop(runtime) == 0
    (again,) = (tmp_path / "kept").glob("recording-2")
    assert "enable_refused" in events(again)


# -- A node of ROS 2, as rmw_zenoh_cpp sets its sessions up, beside a simulated fleet.


def test_a_session_like_a_ros_2_nodes_joins_simulated_boats(tmp_path: Path) -> None:
    port, log = free_port(), tmp_path / "log.txt"
    words = ["--key-format", "rmw_zenoh", "--zenoh-port", port, "--domain", 3, "--max-time", 60]
    config = zenoh.Config()
    for name, value in {  # DEFAULT_RMW_ZENOH_SESSION_CONFIG.json5
        "mode": "peer",
        "connect/endpoints": [f"tcp/{LOOPBACK}:{port}"],
        "listen/endpoints": [f"tcp/{LOOPBACK}:0"],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
    }.items():
        config.insert_json5(name, json.dumps(value))
    heard: list[bytes] = []
    with (
        running("sitl", "--vessels", 1, *words, "--out", tmp_path / "sim", log=log) as simulator,
        zenoh.open(config) as node,
    ):
        decisions = key(TOPICS["decision"], "wamv1", "rmw_zenoh", domain=3)
        stamps_ns: list[int] = []

        def hear(sample: zenoh.Sample) -> None:
            stamps_ns.append(cdr.decode_decision(sample.payload.to_bytes()).stamp_ns)
            heard.append(sample.attachment.to_bytes())

        handler = zenoh.handlers.Callback(hear, indirect=False)
        listener = node.declare_subscriber(decisions, handler)
        wait_until(lambda: len(heard) > 5)
        assert {len(attached) for attached in heard} == {33}
        assert abs(stamps_ns[-1] - time.time_ns()) < 60e9  # the time at which it was made
        tokens = node.liveliness().get("@ros2_lv/3/**")
        graph = {
            str(reply.ok.key_expr).split("/")[8]
            for reply in tokens
            if "/MP/" in str(reply.ok.key_expr)
        }
        assert {"simulator", "twinscrew"} <= graph
        # A goal as a node would give it, which takes the boat from its own.
        route = key(TOPICS["route"], "wamv1", "rmw_zenoh", domain=3)
        empty = cdr.encode_path(odometry(0.0).position_N[None, :2][:0], stamp_ns=0, frame_id="")
        node.put(route, empty, attachment=attachment(1, time.time_ns(), b"0123456789abcdef"))
        told = key(TOPICS["diagnostics"], "wamv1", "rmw_zenoh", domain=3)
        said: list[str] = []
        events_handler = zenoh.handlers.Callback(
            lambda s: said.extend(e.detail for e in cdr.decode_diagnostics(s.payload.to_bytes())),
            indirect=False,
        )
        other = node.declare_subscriber(told, events_handler)
        wait_until(lambda: any("active -> ready" in text or text == "ready" for text in said))
        assert simulator.poll() is None
        del listener, other

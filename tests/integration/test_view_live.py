"""Watching boats over Zenoh: real sockets, and the bytes of a real run."""

import json
import socket
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.viewer import sources
from twinscrew.hil_sim.viewer.scene import write_scene
from twinscrew.runtime.app.recording import find_recordings
from twinscrew.runtime.bus.zenoh import ZenohBus
from twinscrew.runtime.bus.zenoh_config import ZenohSettings
from twinscrew.runtime.errors import BusError, ConfigError
from twinscrew.runtime.messages import cdr

PATIENCE_S = 30.0
LAST = 100
"""[-] Messages of a boat that are said again: those of about 1.3 s."""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    scenario = replace(load_scenario("head_on"), time_limit_s=3.0)
    sail(scenario, SitlSettings(lockstep=True), folder)
    write_scene(folder, scenario)
    return folder


@pytest.fixture
def endpoint():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


class Boats:
    """Two boats that say again and again what they said in a run, on one endpoint."""

    def __init__(self, run, endpoint):
        self.bus = ZenohBus(ZenohSettings(listen=(endpoint,), connect=()), "wamv1")
        recordings = find_recordings(run)
        self.said = {r.vessel: list(r.messages()) for r in recordings}
        self.last = {
            name: cdr.decode_odometry(
                next(m.payload for m in reversed(said) if m.topic == "odometry")
            )
            for name, said in self.said.items()
        }
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self):
        while not self._stop.wait(0.05):
            for name, said in self.said.items():
                face = self.bus.within(name)
                for message in said[-LAST:]:
                    if message.topic != "engagement":
                        face.publish(message.topic, message.payload)

    def close(self):
        self._stop.set()
        self._thread.join()
        self.bus.close()


@pytest.fixture
def boats(run, endpoint):
    boats = Boats(run, endpoint)
    yield boats
    boats.close()


def views(source):
    source.follow()
    return [json.loads(part.head) for part in source.parts(source.now_s())]


def until(condition):
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.02)


def complete(view):
    return view["pose"] is not None and view["points"] > 0 and view["decisions"] > 0


def test_a_viewer_sees_all_boats_of_an_endpoint(boats, endpoint):
    source = sources.from_endpoint(endpoint, "wamv1, wamv2", "vrx32")
    try:
        until(lambda: all(complete(view) for view in views(source)))
        until(lambda: all(view["goal"] is not None for view in views(source)))
        shown = {view["name"]: view for view in views(source)}
        assert list(shown) == ["wamv1", "wamv2"]
        for name, odometry in boats.last.items():
            place = np.array(shown[name]["pose"][:2])
            assert np.hypot(*(place - odometry.position_N[:2])) < 6.0, "the way of those messages"
        assert set(source.trails()) == {"wamv1", "wamv2"}
    finally:
        source.close()


def test_a_viewer_never_says_a_word(boats, endpoint):
    heard = []
    for name in boats.said:
        for topic in ("goal", "engagement", "thrust_left", "thrust_right"):
            ZenohBus.subscribe(boats.bus.within(name), topic, lambda m: heard.append(m.topic))
    boats._stop.set()
    boats._thread.join()
    heard.clear()
    source = sources.from_endpoint(endpoint, "wamv1,wamv2", "vrx32")
    for _ in range(20):
        views(source)
        time.sleep(0.01)
    source.close()
    assert heard == []


def test_a_viewer_that_nobody_looks_at_keeps_a_bounded_number_of_messages(boats, endpoint):
    source = sources.from_endpoint(endpoint, "wamv1", "vrx32")
    try:
        until(lambda: source._inboxes[0].passed_over.get("odometry", 0) > 200)
        assert len(source._inboxes[0].wait(0.0)) < 300
    finally:
        source.close()


def test_a_viewer_finds_the_boats_again_after_they_were_away(run, endpoint):
    boats = Boats(run, endpoint)
    source = sources.from_endpoint(endpoint, "wamv1", "vrx32")
    try:
        until(lambda: complete(views(source)[0]))
        boats.close()
        until(lambda: views(source)[0]["silent_s"] > 1.0)
        assert views(source)[0]["points"] == 0
        boats = Boats(run, endpoint)
        until(lambda: views(source)[0]["silent_s"] < 0.5)
    finally:
        source.close()
        boats.close()


def test_a_boats_own_configuration_tells_where_it_is(boats, endpoint, tmp_path):
    file = tmp_path / "boat.toml"
    file.write_text(f'name = "wamv2"\nsensor = "vrx32"\n[bus]\nconnect = ["{endpoint}"]\n')
    source = sources.from_configs([file])
    try:
        until(lambda: complete(views(source)[0]))
        assert source.names == ("wamv2",)
    finally:
        source.close()


def test_an_endpoint_where_nobody_is_is_refused(endpoint):
    with pytest.raises(BusError, match="cannot be opened"):
        sources.from_endpoint(endpoint, "wamv1", "vrx32")


@pytest.mark.parametrize("names", ["", " , "])
def test_no_name_is_refused(names, endpoint):
    with pytest.raises(ConfigError, match="--names"):
        sources.from_endpoint(endpoint, names, "vrx32")


def test_a_folder_where_nothing_sails_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="no run in real time"):
        sources.from_run(tmp_path)

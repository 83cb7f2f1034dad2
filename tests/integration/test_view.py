"""The live view's page in a real browser: headless Chromium, as Debian packages it."""

import re
import signal
import socket
import subprocess
import sys
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from matplotlib.path import Path
from tests.harness.page import (
    MIDDLE,
    PATIENCE_S,
    Viewer,
    colours,
    drawn_on,
    frames,
    open_layers,
    pause_at,
    seek,
    style_colour,
    told,
    until,
    visit,
    wants_chromium,
    without,
)

from twinscrew.hil_sim.scenario import load_scenario
from twinscrew.hil_sim.sitl import SitlSettings, sail
from twinscrew.hil_sim.viewer.scene import write_scene
from twinscrew.runtime.policy.colregs import ColregsSettings, in_crossing_zone, in_head_on_zone

pytestmark = [pytest.mark.slow, wants_chromium]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    scenario = replace(load_scenario("crossing"), time_limit_s=8.0)
    sail(scenario, SitlSettings(lockstep=True), folder)
    write_scene(folder, scenario)
    return folder


@pytest.fixture(scope="module")
def viewer(run):
    viewer = Viewer("--replay", str(run))
    yield viewer
    viewer.stop()


def test_it_connects_and_draws_both_vessels_on_the_water(page, viewer):
    visit(page, viewer)
    assert told(page, "connection") == "open"
    counted = colours(page)
    assert counted[style_colour(page, "water")] > sum(counted.values()) / 2
    for vessel in ("v0", "v1"):
        assert counted.get(style_colour(page, vessel), 0) > 50, f"{vessel} is not on the chart"
    assert page.locator(".card").count() == 2
    assert "m/s" in page.locator(".card .speed").first.inner_text()


def test_a_run_far_from_the_origin_is_shown_as_near_as_any_other(page, tmp_path):
    near = load_scenario("crossing")
    shift_m = np.array([1e5, -2e5])
    starts = near.starts + np.array([*shift_m, 0.0])
    far = replace(near, starts=starts, goals=near.goals + shift_m, time_limit_s=3.0)
    sail(far, SitlSettings(lockstep=True), tmp_path)
    write_scene(tmp_path, far)
    viewer = Viewer("--replay", str(tmp_path))
    try:
        visit(page, viewer)
        for vessel in ("v0", "v1"):
            assert colours(page).get(style_colour(page, vessel), 0) > 50
    finally:
        viewer.stop()


def test_the_chart_fits_though_frames_come_before_the_screens_first_picture(page, viewer):
    page.add_init_script(
        """window.ResizeObserver = class extends ResizeObserver {
            constructor(tell) { super((...told) => setTimeout(() => tell(...told), 1e6)); }
        };"""
    )
    visit(page, viewer)
    for vessel in ("v0", "v1"):
        assert colours(page).get(style_colour(page, vessel), 0) > 50


def test_it_needs_nothing_but_its_own_server_and_complains_of_nothing(page, viewer):
    visit(page, viewer)
    page.keyboard.press("1")
    page.keyboard.press("?")
    page.keyboard.press("Escape")
    foreign = [url for url in page.visited if not url.startswith(viewer.url)]
    assert foreign == []
    assert page.complaints == []


def test_it_keeps_the_followed_vessel_in_the_middle(page, viewer):
    visit(page, viewer)
    page.keyboard.press("2")
    assert told(page, "following") == "wamv2"
    for _ in range(5):
        page.keyboard.press("+")
    for seconds in (1.0, 6.0):
        seek(page, seconds)
        until(lambda: colours(page, *MIDDLE).get(style_colour(page, "v1"), 0) > 50)
    page.locator("#chart").focus()
    page.keyboard.press("ArrowLeft")
    assert told(page, "following") == "", "who moves the chart looks elsewhere"


def test_dragging_and_the_wheel_move_the_chart(page, viewer):
    visit(page, viewer)
    page.keyboard.press("Space")
    until(lambda: page.locator("#play").inner_text() == "Play")
    page.keyboard.press("1")
    until(lambda: colours(page, *MIDDLE).get(style_colour(page, "v0"), 0) > 20)
    near = colours(page)[style_colour(page, "v0")]
    page.mouse.move(300, 300)
    page.mouse.wheel(0, -600)
    until(lambda: colours(page).get(style_colour(page, "v0"), 0) > 2 * near)
    page.mouse.down()
    page.mouse.move(60, 100, steps=4)
    page.mouse.up()
    assert told(page, "following") == ""
    until(lambda: colours(page, *MIDDLE).get(style_colour(page, "v0"), 0) == 0)
    page.locator("#fit").click()
    until(lambda: 0 < colours(page).get(style_colour(page, "v0"), 0) < 2 * near)


def test_the_drawn_zones_are_those_that_the_runtime_checks(page, viewer):
    visit(page, viewer)
    drawn = page.evaluate(
        """async (zones) => {
            const { headOnZone, crossingZone } = await import("/draw.js");
            return [headOnZone(zones), crossingZone(zones)];
        }""",
        msgspec.to_builtins(ColregsSettings()),
    )
    x, y = np.random.default_rng(0).uniform(-20.0, 20.0, (2, 20_000))
    for corners, inside in zip(drawn, (in_head_on_zone, in_crossing_zone), strict=True):
        shown = Path(corners).contains_points(np.column_stack([x, y]))
        assert 0.05 < shown.mean() < 0.5
        np.testing.assert_array_equal(shown, inside(x, y))


def test_the_slider_goes_back_and_on(page, viewer):
    visit(page, viewer)
    page.keyboard.press("Space")
    until(lambda: page.locator("#play").inner_text() == "Play")
    for seconds in (5.0, 2.0, 7.0):
        page.locator("#slider").fill(str(seconds))
        until(lambda wanted=seconds: float(told(page, "time")) == wanted)


def test_in_a_pause_time_stands_still_and_goes_on_from_there(page, viewer):
    visit(page, viewer)
    page.keyboard.press("Space")
    until(lambda: page.locator("#play").inner_text() == "Play")
    paused = told(page, "time"), frames(page)
    page.wait_for_timeout(500)
    assert (told(page, "time"), frames(page)) == paused
    page.keyboard.press("Space")
    until(lambda: frames(page) > paused[1] + 2)
    assert float(told(page, "time")) >= float(paused[0])


def test_layers_can_be_hidden(page, viewer):
    visit(page, viewer)
    page.keyboard.press("Space")
    until(lambda: page.locator("#play").inner_text() == "Play")
    seek(page, 6.0)
    with_all = colours(page)
    open_layers(page)
    for box in page.locator("#layers input").all():
        box.uncheck()
    page.wait_for_timeout(200)
    bare = colours(page)
    water = style_colour(page, "water")
    assert bare[water] > with_all[water]
    assert bare.get(style_colour(page, "v0"), 0) > 50, "vessels are no layer"


def test_it_can_be_used_without_a_mouse(page, viewer):
    visit(page, viewer)
    page.locator("#chart").focus()
    reached = []
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate("document.activeElement.id || document.activeElement.className")
        )
        if reached[-1] == "follow":
            break
    assert reached[-1] == "follow", reached
    page.keyboard.press("Enter")
    assert told(page, "following") == "wamv1"


def test_it_turns_dark_with_the_system(page, viewer):
    visit(page, viewer)
    light = style_colour(page, "water")
    page.emulate_media(color_scheme="dark")
    until(lambda: style_colour(page, "water") != light)
    dark = style_colour(page, "water")
    until(lambda: colours(page).get(dark, 0) > colours(page).get(light, 0))


def test_it_survives_a_restart_of_its_server(page, run):
    viewer = Viewer("--replay", str(run))
    visit(page, viewer)
    viewer.stop()
    until(lambda: told(page, "connection") == "lost")
    assert page.locator("#notice").is_visible()
    again = Viewer("--replay", str(run), port=viewer.port)
    try:
        seen = frames(page)
        until(lambda: told(page, "connection") == "open" and frames(page) > seen + 2)
        assert not page.locator("#notice").is_visible()
        assert page.locator(".card").count() == 2
    finally:
        again.stop()


@pytest.mark.parametrize("layer", ["points", "objects", "tracks", "zones", "trails", "goals"])
def test_every_layer_draws_something_of_a_crossing(page, viewer, layer):
    pause_at(page, viewer, 6.0)
    assert without(page, layer) > 20


def test_a_longer_way_leaves_a_longer_trail(page, viewer):
    pause_at(page, viewer, 2.0)
    short = without(page, "trails")
    open_layers(page)
    page.locator("#layers input[name=trails]").check()
    page.locator("#slider").fill("7")
    until(lambda: float(told(page, "time")) == 7.0)
    assert without(page, "trails") > short


def test_bars_show_what_each_propeller_was_told(page, viewer):
    pause_at(page, viewer, 6.0)
    card = page.locator(".card").first
    newtons = [int(words.split()[0]) for words in card.locator(".newtons").all_inner_texts()]
    assert any(newtons)
    whole = card.locator(".bar").first.bounding_box()["width"]
    for side, told_n in enumerate(newtons):
        bar = card.locator(".bar i").nth(side).bounding_box()
        assert bar["width"] / whole == pytest.approx(abs(told_n) / 1500.0, abs=0.03)


def test_cards_tell_the_state_and_its_changes(page, viewer):
    pause_at(page, viewer, 6.0)
    assert page.locator(".card .state").all_inner_texts() == ["active", "active"]
    page.locator("#slider").fill("0")
    until(lambda: float(told(page, "time")) == 0.0)
    assert page.locator(".state[data-state=active]").count() == 0


def test_the_sparkline_is_drawn_to_the_scale_of_its_largest_value(page, viewer):
    visit(page, viewer)
    rows = page.evaluate(
        """async () => {
            const { drawSparkline } = await import("/panel.js");
            const canvas = document.createElement("canvas");
            canvas.style.cssText = "width: 120px; height: 20px";
            document.body.append(canvas);
            const rows = (values) => {
                drawSparkline(canvas, values, "#000000");
                const { width, height } = canvas;
                const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
                const drawn = [];
                for (let i = 3; i < data.length; i += 4) {
                    if (data[i] > 100) drawn.push(Math.floor(i / 4 / width) / height);
                }
                return [Math.min(...drawn), Math.max(...drawn)];
            };
            return [rows([2, 2, 2]), rows([0, 4, 0]), rows([0.1, 0.1])];
        }"""
    )
    level, peak, low = rows
    assert level[1] < 0.3
    assert peak[0] < 0.2
    assert peak[1] > 0.7
    assert low[0] > 0.6, "less than a millisecond is not blown up"


def test_a_run_in_real_time_is_seen_as_it_sails(page, tmp_path):
    command = [sys.executable, "-m", "twinscrew.runtime.cli", "sitl", "--scenario", "crossing"]
    command += ["--max-time", "12", "--out", str(tmp_path / "run"), "--view", "--port", "0"]
    with (tmp_path / "said.txt").open("w+") as said:
        sitl = subprocess.Popen(command, stdout=said, stderr=said)
        try:
            until(lambda: re.search(r"http://[\d.:]+", (tmp_path / "said.txt").read_text()))
            page.goto(re.search(r"http://[\d.:]+", (tmp_path / "said.txt").read_text())[0])
            until(lambda: page.locator(".state[data-state=active]").count() == 2)
            assert page.locator("#mode").inner_text() == "live, crossing"
            assert not page.locator("#slider").is_visible()
            page.keyboard.press("1")
            until(lambda: colours(page, *MIDDLE).get(style_colour(page, "v0"), 0) > 20)
            until(lambda: "ms" in page.locator(".card .ms").first.inner_text())
            until(lambda: drawn_on(page, ".spark") > 20)
            page.keyboard.press("Space")  # others see on; the boats sail on
            until(lambda: page.locator("#play").inner_text() == "Play")
            stands = frames(page)
            page.wait_for_timeout(400)
            assert frames(page) == stands
            page.keyboard.press("Space")
            until(lambda: frames(page) > stands)
            until(lambda: told(page, "mode") == "recording")  # the run is over
            assert page.complaints == [] or all("WebSocket" in c for c in page.complaints)
        finally:
            sitl.send_signal(signal.SIGINT)
            sitl.wait(PATIENCE_S)
    assert sitl.returncode in {0, 1}, (tmp_path / "said.txt").read_text()
    assert (tmp_path / "run" / "summary.json").is_file()


def test_a_port_in_use_is_refused_in_one_line(run):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        command = [sys.executable, "-m", "twinscrew.runtime.cli", "view", "--replay", str(run)]
        refused = subprocess.run(
            [*command, "--port", str(port)], capture_output=True, text=True, timeout=PATIENCE_S
        )
    assert refused.returncode == 2
    assert refused.stderr.strip().splitlines()[-1].startswith("twinscrew: error: --port: port")

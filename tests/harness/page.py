"""The live view's page in a real browser: headless Chromium, as Debian packages it."""

import json
import shutil
import subprocess
import sys
import time

import pytest

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
wants_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium: apt-get install chromium (Debian), or put one on PATH"
)
PATIENCE_S = 200.0
"""[s] After this long without what is waited for, the test has failed; nothing is timed."""
MIDDLE = (0.44, 0.44, 0.56, 0.56)
DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}


class Viewer:
    """`twinscrew view` in a process of its own."""

    def __init__(self, *arguments, port=0):
        command = [sys.executable, "-m", "twinscrew.runtime.cli", "view", *arguments]
        self.process = subprocess.Popen(
            [*command, "--port", str(port)], stdout=subprocess.PIPE, text=True
        )
        self.url = self.process.stdout.readline().strip()
        assert self.url, "the viewer did not start"
        self.port = int(self.url.rpartition(":")[2])

    def stop(self):
        self.process.terminate()
        assert self.process.wait(PATIENCE_S) == 0
        self.process.stdout.close()


def complain(page, said):
    """Keep what the page complains of, but not the advice about these tests' look at its pixels."""
    if "willReadFrequently" not in said:
        page.complaints.append(said)


def until(condition):
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, "waited in vain"
        time.sleep(0.05)


def told(page, name):
    return page.evaluate(f"document.body.dataset.{name} ?? ''")


def frames(page):
    return int(told(page, "frames") or 0)


def visit(page, viewer):
    page.goto(viewer.url)
    until(lambda: frames(page) >= 3)


def colours(page, left=0.0, top=0.0, right=1.0, bottom=1.0):
    """Count the pixels of each colour in a part of the chart, in shares of its size."""
    counted = page.evaluate(
        """([left, top, right, bottom]) => {
            const chart = document.getElementById("chart");
            const [x, y] = [left * chart.width, top * chart.height].map(Math.floor);
            const [w, h] = [(right - left) * chart.width, (bottom - top) * chart.height];
            const { data } = chart.getContext("2d").getImageData(x, y, Math.ceil(w), Math.ceil(h));
            const counts = {};
            for (let i = 0; i < data.length; i += 4) {
                const key = [data[i], data[i + 1], data[i + 2]].join();
                counts[key] = (counts[key] ?? 0) + 1;
            }
            return JSON.stringify(counts);
        }""",
        [left, top, right, bottom],
    )
    return {tuple(map(int, key.split(","))): count for key, count in json.loads(counted).items()}


def style_colour(page, name):
    digits = page.evaluate(
        f"getComputedStyle(document.documentElement).getPropertyValue('--{name}').trim()"
    )
    return tuple(bytes.fromhex(digits.removeprefix("#")))


def drawn_on(page, selector):
    """Count the pixels of a canvas that are not empty."""
    return page.evaluate(
        """(selector) => {
            const canvas = document.querySelector(selector);
            const { width, height } = canvas;
            const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
            return data.filter((value, i) => i % 4 === 3 && value > 0).length;
        }""",
        selector,
    )


def seek(page, seconds):
    page.locator("#slider").fill(str(seconds))
    until(lambda: abs(float(told(page, "time")) - seconds) < 1.0)


def pause_at(page, viewer, seconds):
    """Show one moment, with a vessel followed."""
    visit(page, viewer)
    page.keyboard.press("Space")
    until(lambda: page.locator("#play").inner_text() == "Play")
    page.locator("#slider").fill(str(seconds))
    until(lambda: float(told(page, "time")) == seconds)
    page.keyboard.press("1")


def without(page, layer):
    """Give how many pixels change when a layer is hidden."""
    page.wait_for_timeout(200)
    shown = colours(page)
    open_layers(page)
    page.locator(f"#layers input[name={layer}]").uncheck()
    until(lambda: colours(page) != shown)
    hidden = colours(page)
    return sum(abs(shown.get(key, 0) - hidden.get(key, 0)) for key in {*shown, *hidden}) / 2


def pause(page):
    """Hold time."""
    page.locator("#chart").focus()
    page.keyboard.press("Space")
    until(lambda: page.locator("#play").inner_text() == "Play")


def open_layers(page):
    """Have the boxes of the layers in sight: on a small screen a button opens them."""
    if not page.locator("#layers").is_visible():
        page.locator("#layers-button").click()


def labels(page):
    """Give the words on the chart, with their boxes, as the last picture had them."""
    return page.evaluate("window.twinscrew.chart.labels")

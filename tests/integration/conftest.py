"""A browser for the tests of the page."""

import os

import pytest
from tests.harness.page import CHROMIUM, complain

from twinscrew.hil_sim.drivers.processes import LOOPBACK, free_port


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"] if os.geteuid() == 0 else []
        )
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser):
    page = browser.new_page(viewport={"width": 1000, "height": 700}, color_scheme="light")
    page.complaints, page.visited = [], []
    page.on("console", lambda said: complain(page, said.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on("request", lambda request: page.visited.append(request.url))
    yield page
    page.close()


@pytest.fixture
def endpoint():
    """Give a Zenoh endpoint of this machine that nobody listens at."""
    return f"tcp/{LOOPBACK}:{free_port()}"

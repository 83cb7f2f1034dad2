"""The same script against any ArduPilot Rover boat: ours always, a real one if there is a binary.

    ARDUROVER=/path/to/ardurover pytest tests/integration/test_mavlink_conformance.py

`python -m tests.conformance` prints the same as a table.
"""

import os
from pathlib import Path

import pytest
from tests.conformance.endpoints import Ours, Real
from tests.conformance.station import Station
from tests.conformance.steps import STEPS

BINARY = os.environ.get("ARDUROVER", "")


@pytest.fixture(scope="module", params=["ours", "ardurover"])
def station(request, tmp_path_factory):
    if request.param == "ardurover" and not BINARY:
        pytest.skip("no ArduRover binary: set ARDUROVER to its path to try the real one")
    real = request.param == "ardurover"
    endpoint = Real(Path(BINARY), tmp_path_factory.mktemp("ardurover")) if real else Ours()
    yield Station(endpoint)
    endpoint.close()


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.__name__)
def test_it_does_what_was_seen_on_the_real_one(station, step) -> None:
    step(station)

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


@pytest.fixture
def ours():
    endpoint = Ours()
    yield endpoint
    endpoint.close()


def test_accelerometers_that_are_not_calibrated_are_calibrated(ours) -> None:
    ours.wait()
    assert not ours.rover.arm()
    assert ours.rover.refusal == "Arm: 3D Accel calibration needed"
    Station(ours).ready()
    assert ours.rover.armed


def test_a_refusal_that_does_not_pass_ends_a_step_in_seconds_with_the_autopilots_words(ours):
    ours.rover.parameters.set("RC3_TRIM", 1600.0)
    with pytest.raises(AssertionError, match=r"does not arm: Arm: Throttle \(RC3\) is not neutral"):
        Station(ours).ready()
    assert ours.now_s < 20.0


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.__name__)
def test_it_does_what_was_seen_on_the_real_one(station, step) -> None:
    step(station)

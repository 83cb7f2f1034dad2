"""What the doctor says of an autopilot and of each of its parameters."""

import pytest

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import RoverSettings
from twinscrew.runtime.doctor.checks import Verdict
from twinscrew.runtime.doctor.listening import judge_autopilot, judge_parameter
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings
from twinscrew.runtime.link.ardupilot.parameters import ParameterState, expected_parameters
from twinscrew.runtime.mavlink import Signing


def listened(seconds: float, *, write: bool = False, **parameters: float) -> dict:
    """The doctor's lines after a while with a simulated autopilot, by what they are about."""
    rover = RoverSettings(parameters=parameters)
    autopilot = RoverAutopilot(RoverAutopilotSettings(rover=rover), 1)
    link = AutopilotLink(AutopilotSettings(write_parameters=write))
    for k in range(round(seconds / 0.05)):
        now_s = k * 0.05
        link.receive(autopilot.step(now_s), now_s)
        autopilot.receive(link.command(None, now_s) + link.tick(now_s), now_s)
    return {finding.what: finding for finding in judge_autopilot(link)}


def test_every_parameter_has_a_line_with_what_it_is_and_what_it_must_be() -> None:
    lines = listened(5.0, MOT_SLEWRATE=50.0)
    assert set(lines) == {"autopilot", *expected_parameters(1)}
    bad = {what for what, line in lines.items() if line.verdict is not Verdict.OK}
    assert bad == {"MOT_SLEWRATE"}
    assert lines["MOT_SLEWRATE"].found == "50, must be 0"
    assert "--write-params" in lines["MOT_SLEWRATE"].advice
    assert lines["PILOT_STEER_TYPE"].found == "1, must be 1"


def test_what_was_written_is_named_with_what_it_was() -> None:
    line = listened(5.0, write=True, MOT_SLEWRATE=50.0)["MOT_SLEWRATE"]
    assert line.verdict is Verdict.WARN
    assert line.found == "0, must be 0; it was 50 and has been written"
    assert "restart" in line.advice


def test_a_vehicle_that_is_no_boat_fails_and_its_parameters_are_still_told() -> None:
    lines = listened(5.0, FRAME_CLASS=1.0)
    assert lines["autopilot"].verdict is Verdict.FAIL
    assert lines["FRAME_CLASS"].found == "1, must be 2"


def test_where_nothing_is_heard_there_is_one_line() -> None:
    link = AutopilotLink(AutopilotSettings())
    (line,) = judge_autopilot(link)
    assert (line.verdict, line.found) == (Verdict.FAIL, "nothing is heard")


@pytest.mark.parametrize(
    ("missing", "verdict", "word"),
    [(True, Verdict.FAIL, "firmware"), (False, Verdict.WARN, "longer")],
)
def test_a_parameter_that_was_not_answered(missing, verdict, word) -> None:
    line = judge_parameter(ParameterState("FS_ACTION", 2.0, None, missing, None))
    assert line.verdict is verdict
    assert word in line.advice


KEY, OTHER_KEY = bytes(range(32)), bytes([9] * 32)


@pytest.mark.parametrize(
    ("theirs", "ours", "found", "advice"),
    [
        (OTHER_KEY, KEY, "signed with another key", "signing_key_file is not the autopilot's"),
        (None, KEY, "not signed with our key, or any", "twinscrew signing setup"),
        (KEY, None, "it signs what it sends", "give its key"),
        (KEY, KEY, "mode MANUAL, disarmed", ""),
    ],
)
def test_keys_that_differ_are_named_and_no_cable_is_blamed(theirs, ours, found, advice) -> None:
    signing = [None if key is None else Signing(key) for key in (theirs, ours)]
    pilot = RoverAutopilot(RoverAutopilotSettings(), 1, signing=signing[0])
    link = AutopilotLink(AutopilotSettings(), signing=signing[1])
    for k in range(40):
        said = pilot.step(k * 0.05)
        if ours is None or link.wire.recognises(said):  # as a listening UDP port looks
            link.receive(said, k * 0.05)
        pilot.receive(link.command(None, k * 0.05) + link.tick(k * 0.05), k * 0.05)
    line = judge_autopilot(link)[0]
    assert found in line.found
    assert advice in line.advice
    assert "cable" not in line.advice

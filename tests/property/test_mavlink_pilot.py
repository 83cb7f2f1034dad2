"""Whatever happens, in whatever order: a pilot's choice wins."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.harness.work import examples

from twinscrew.hil_sim.autopilot.endpoint import RoverAutopilot, RoverAutopilotSettings
from twinscrew.hil_sim.autopilot.rover import Mode, RoverSettings
from twinscrew.runtime.link.ardupilot.link import AutopilotLink, AutopilotSettings

STEP_S = 0.05
DEEDS = st.sampled_from(["hold", "manual", "disarm", "cut", "mend", "nothing"])
STORIES = st.lists(st.tuples(DEEDS, st.integers(1, 100)), min_size=1, max_size=12)


class Afternoon:
    """A boat, its runtime, a pilot at a ground station, and a line that may be cut."""

    def __init__(self, *, receiver):
        rover = RoverSettings(receiver=receiver)
        self.link = AutopilotLink(
            AutopilotSettings(arm=True, receiver_fitted=receiver, check_parameters=False)
        )
        self.autopilot = RoverAutopilot(RoverAutopilotSettings(rover=rover), 1)
        self.is_cut, self.now_s = False, 0.0
        self.pilot_holds = self.pilot_disarmed = False

    def do(self, deed):
        rover = self.autopilot.rover
        if deed == "hold" and rover.mode is Mode.MANUAL:
            rover.set_mode(Mode.HOLD)
            self.pilot_holds = self.link.status.connected and not self.is_cut
        elif deed == "manual":
            rover.set_mode(Mode.MANUAL)
            self.pilot_holds = False
        elif deed == "disarm" and rover.armed:
            rover.disarm()
            self.pilot_disarmed = True
        elif deed in ("cut", "mend"):
            self.is_cut = deed == "cut"

    def step(self):
        self.now_s = round(self.now_s + STEP_S, 6)
        sent = self.link.tick(self.now_s) + self.link.command((300.0, 300.0), self.now_s)
        self.autopilot.receive(b"" if self.is_cut else sent, self.now_s)
        answer = self.autopilot.step(self.now_s)
        self.link.receive(b"" if self.is_cut else answer, self.now_s)
        self.link.events(self.now_s)


@pytest.mark.slow
@settings(max_examples=examples(60), deadline=None)
@given(STORIES, st.booleans())
def test_hold_and_disarmed_by_a_pilot_stay_so_until_he_says_otherwise(story, receiver):
    day = Afternoon(receiver=receiver)
    for _ in range(40):
        day.step()
    for deed, steps in story:
        day.do(deed)
        for _ in range(steps):
            day.step()
            rover = day.autopilot.rover
            assert not (day.pilot_holds and rover.mode is Mode.MANUAL)
            assert not (day.pilot_disarmed and rover.armed)
            thrust = day.autopilot.thrust_command_N()
            assert not thrust.any() or (rover.armed and rover.mode is Mode.MANUAL)


@pytest.mark.slow
@settings(max_examples=examples(20), deadline=None)
@given(STORIES)
def test_once_the_line_is_mended_and_the_pilot_gives_manual_the_boat_sails(story):
    day = Afternoon(receiver=False)
    for deed, steps in [("nothing", 40), *story, ("mend", 60), ("manual", 40)]:
        day.do(deed)
        for _ in range(steps):
            day.step()
    sails = day.autopilot.thrust_command_N().tolist() == [300.0, 300.0]
    assert sails or day.pilot_disarmed

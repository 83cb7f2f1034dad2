"""A page's place in time."""

import json
import struct

import pytest

from twinscrew.hil_sim.viewer.scene import Scene
from twinscrew.hil_sim.viewer.server import Player
from twinscrew.hil_sim.viewer.wire import Request


class Fixed:
    """A source without vessels: only its time counts."""

    names = ()
    scene = Scene()

    def __init__(self, mode, duration_s=0.0, now_s=0.0):
        self.mode, self.duration_s, self.now = mode, duration_s, now_s

    def now_s(self):
        return self.now

    def parts(self, time_s):
        return ()


def head(frame):
    (size,) = struct.unpack_from("<I", frame)
    return json.loads(frame[4 : 4 + size])


def time_of(frame):
    return head(frame)["time_s"]


def test_a_recording_plays_at_the_clocks_pace():
    player = Player(Fixed("recording", 10.0))
    assert [time_of(player.frame(clock_s)) for clock_s in (50.0, 50.1, 50.7)] == [0.0, 0.1, 0.7]


def test_speed_multiplies_and_is_kept_within_reason():
    player = Player(Fixed("recording", 100.0))
    player.frame(0.0)
    player.ask(Request(speed=4.0))
    assert time_of(player.frame(1.0)) == 4.0
    player.ask(Request(speed=1e9))
    assert time_of(player.frame(2.0)) == 20.0
    player.ask(Request(speed=float("nan")))
    assert time_of(player.frame(3.0)) == 36.0


def test_in_a_pause_one_frame_tells_of_it_and_then_there_is_silence():
    player = Player(Fixed("recording", 10.0))
    player.frame(0.0)
    player.ask(Request(playing=False))
    told = head(player.frame(0.1))
    assert told["playing"] is False
    assert player.frame(0.2) is None
    player.ask(Request(playing=True))
    assert time_of(player.frame(5.0)) == pytest.approx(told["time_s"] + 4.8)


def test_seeking_in_a_pause_shows_that_moment_and_stays_there():
    player = Player(Fixed("recording", 10.0))
    player.ask(Request(playing=False, seek_s=7.5))
    assert time_of(player.frame(0.0)) == 7.5
    assert player.frame(1.0) is None


@pytest.mark.parametrize(("asked", "shown"), [(-5.0, 0.0), (1e9, 10.0), (float("nan"), 0.0)])
def test_seeking_stays_within_the_recording(asked, shown):
    player = Player(Fixed("recording", 10.0))
    player.ask(Request(seek_s=asked))
    assert time_of(player.frame(0.0)) == shown


def test_a_recording_stops_at_its_end_and_begins_anew_when_asked():
    player = Player(Fixed("recording", 1.0))
    player.frame(0.0)
    end = head(player.frame(60.0))
    assert (end["time_s"], end["playing"]) == (1.0, False)
    assert player.frame(61.0) is None
    player.ask(Request(playing=True))
    assert time_of(player.frame(61.5)) < 1.0


def test_a_live_page_always_shows_the_present_after_a_pause_too():
    source = Fixed("live", now_s=5.0)
    player = Player(source)
    assert time_of(player.frame(0.0)) == 5.0
    player.ask(Request(playing=False))
    player.frame(1.0)
    source.now = 9.0
    assert player.frame(2.0) is None
    player.ask(Request(playing=True, seek_s=1.0))
    assert time_of(player.frame(3.0)) == 9.0

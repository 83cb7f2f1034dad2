"""A recording as a film."""

import json
import shutil

import numpy as np
import pytest

from twinscrew.hil_sim.viewer.sources import FRAME_S, Film, RecordedSource
from twinscrew.hil_sim.viewer.wire import Part
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.recording.recording import Recording, find_recordings


def picture(number):
    return Part(str(number).encode(), b"")


def number(part):
    return int(part.head)


def test_a_film_shows_the_last_picture_until_the_next():
    film = Film()
    for count in range(20):
        film.add(picture(count))
    assert number(film.at(0.0)) == 0
    assert number(film.at(3 * FRAME_S)) == 3
    assert number(film.at(3.9 * FRAME_S)) == 3
    assert number(film.at(-1.0)) == 0
    assert number(film.at(1e6)) == 19


def test_a_long_film_keeps_its_length_at_half_the_rate():
    film = Film(most=100)
    for count in range(1000):
        if film.next_s <= count * FRAME_S + 1e-9:
            film.add(picture(count))
    assert len(film._pictures) <= 100
    for time_s in np.linspace(0.0, 990 * FRAME_S, 37):
        assert number(film.at(time_s)) * FRAME_S == pytest.approx(time_s, abs=2 * film.step_s)


@pytest.mark.slow
def test_a_run_shows_every_vessel_where_its_odometry_said(run):
    source = RecordedSource(run)
    assert source.names == ("wamv1", "wamv2")
    assert source.scene.names == source.names
    for recording, name in zip(find_recordings(run), source.names, strict=True):
        stamped = [m for m in recording.messages() if m.topic in {"points", "odometry"}]
        middle = next(m for m in stamped[len(stamped) // 2 :] if m.topic == "odometry")
        first_ns = min(next(r.messages()).time_ns for r in find_recordings(run))
        time_s = (middle.time_ns - first_ns) * 1e-9
        true_N = cdr.decode_odometry(middle.payload).position_N[:2]
        heads = [json.loads(part.head) for part in source.parts(time_s + FRAME_S)]
        shown = next(head for head in heads if head["name"] == name)
        assert np.hypot(*(np.array(shown["pose"][:2]) - true_N)) < 0.6, "0.1 s at 3 m/s, and slack"
        assert shown["state"] == "active"


def test_the_trail_goes_all_the_way(run):
    source = RecordedSource(run)
    for name, places in source.trails().items():
        index = source.names.index(name)
        end = json.loads(source.parts(source.duration_s)[index].head)["pose"]
        assert np.hypot(places[-1][1] - end[0], places[-1][2] - end[1]) < 0.8
        assert [place[0] for place in places] == sorted(place[0] for place in places)


def test_a_vessel_that_fell_silent_before_the_end_is_shown_so(run, monkeypatch):
    whole = RecordedSource(run)
    original = Recording.messages

    def first_second_of_wamv1(self, topics):
        for message in original(self, topics):
            if self.vessel == "wamv1" and message.time_ns > begin_ns + 1_000_000_000:
                return
            yield message

    begin_ns = min(next(r.messages()).time_ns for r in find_recordings(run))
    monkeypatch.setattr(Recording, "messages", first_second_of_wamv1)
    source = RecordedSource(run)
    assert source.duration_s == whole.duration_s
    silent, heard = (json.loads(part.head)["silent_s"] for part in source.parts(4.0))
    assert silent == pytest.approx(3.0, abs=0.2)
    assert heard < 0.2


def test_one_vessels_recording_can_be_shown_alone(run):
    source = RecordedSource(run / "wamv2")
    assert source.names == ("wamv2",)


def test_two_recordings_of_one_vessel_are_refused(run, tmp_path):
    for name in ("recording", "recording-20261121-120000"):
        shutil.copytree(run / "wamv1" / "recording", tmp_path / name)
    with pytest.raises(RecordingError, match="recording, recording-20261121-120000: choose one"):
        RecordedSource(tmp_path)


def test_a_folder_without_a_recording_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="holds no recording"):
        RecordedSource(tmp_path)


def test_a_bag_that_nothing_of_can_be_shown_of_is_refused(tmp_path):
    from twinscrew.runtime.recording.writer import BagWriter

    bag = BagWriter(tmp_path / "bag", "wamv", {})
    bag.close()
    with pytest.raises(RecordingError):
        RecordedSource(tmp_path / "bag")

"""`twinscrew track` on recordings in the Autoferry benchmark's format."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinscrew.hil_sim.commands.track import TRACKERS, scored
from twinscrew.hil_sim.tracks.autoferry import (
    autoferry_settings,
    read_records,
    read_truth,
    track,
)
from twinscrew.hil_sim.tracks.score import TrackScore, gospa
from twinscrew.runtime.cli.main import main
from twinscrew.runtime.errors import ConfigError

PERIODS = {1: 0.5, 2: 1.68, 4: 0.2}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A minute in which two boats sail past, as a LiDAR, a radar and a camera report it."""
    rng = np.random.default_rng(0)
    own = np.array([10.0, -5.0])

    def boats(t):
        return np.array([[80.0 - 1.5 * t, 30.0], [-60.0, -70.0 + 2.0 * t]])

    records, truth = [], []
    times = sorted((k * dt, sensor) for sensor, dt in PERIODS.items() for k in range(int(60 / dt)))
    for t, sensor in times:
        delay = {1: 0.5, 2: 1.68, 4: 0.0}[sensor]
        seen = boats(t - delay) - own
        if sensor == 4:
            found = (np.arctan2(seen[:, 1], seen[:, 0]) + rng.normal(0, 0.01, 2)).tolist()
        else:
            found = (seen + rng.normal(0, 0.7, (2, 2))).T.tolist()
        records.append(
            {"sensorID": sensor, "ownshipPosition": own.tolist(), "time": t, "measurement": found}
        )
        truth.append(
            [{"targetID": k + 1, "position": [*p, 0], "time": t} for k, p in enumerate(boats(t))]
        )
    folder = tmp_path_factory.mktemp("autoferry")
    (folder / "made_detections.json").write_text(json.dumps(records))
    (folder / "made_truth.json").write_text(json.dumps(truth))
    return folder / "made_detections.json", folder / "made_truth.json"


def test_the_command_prints_frames_and_scores(recording, capsys, monkeypatch):
    detections, truth = map(str, recording)
    options = ["--format", "autoferry", "--sensors", "lidar,radar", "--truth", truth, "--json"]
    monkeypatch.setattr("sys.argv", ["twinscrew", "track", detections, *options])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 0
    answer = json.loads(capsys.readouterr().out)
    used = [r for r in json.loads(recording[0].read_text()) if r["sensorID"] in (1, 2)]
    assert [frame["time_s"] for frame in answer["frames"]] == [r["time"] for r in used]
    keys = {"id", "north_m", "east_m", "v_north_mps", "v_east_mps", "existence"}
    assert all(set(t) == keys for frame in answer["frames"] for t in frame["tracks"])
    scores = answer["scores"]
    assert scores["identity_switches"] == 0
    assert scores["false_tracks_per_minute"] == 0.0
    assert max(scores["time_to_first_track_s"].values()) < 12.0
    assert scores["gospa_rms_m"] < 9.0


def test_errors_are_as_large_as_stated_after_the_records_of_each_sensor(recording):
    records, truth = read_records(recording[0]), read_truth(recording[1])
    sensors = ["lidar", "radar", "eo"]
    frames = list(track(records, sensors, autoferry_settings()))
    nees = scored(records, sensors, frames, truth)["nees"]
    assert set(nees) == set(sensors)
    for figures in nees.values():
        assert figures["in_95_band"] > 0.9
        assert figures["mean"] < 3.0


def test_values_are_chosen_on_the_other_recordings(recording, tmp_path, capsys, monkeypatch):
    """A value that is best on this recording alone is not the one that it is scored with."""
    detections, truth = map(str, recording)
    empty = tmp_path / "empty_detections.json"  # one boat that no sensor has seen
    entries = json.loads(recording[0].read_text())
    empty.write_text(json.dumps([{**entry, "measurement": []} for entry in entries]))
    files = [detections, str(empty), "--truth", truth, "--truth", truth]
    vary = ["--vary", "tracker.existence.confirm=0.999,1.0", "--sensors", "lidar,radar"]
    monkeypatch.setattr("sys.argv", ["twinscrew", "track", *files, *vary])
    monkeypatch.setenv("COLUMNS", "160")
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 0
    rows = capsys.readouterr().out.splitlines()
    (unseen,) = [row for row in rows if "empty" in row]
    assert "20.00" in unseen
    assert "confirm = 0.999" in unseen


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ("tracker.existence.confirm", "is not KEY=VALUE"),
        ("tracker.existence.confirm=a", "are no values"),
        ("tracker.existence.konfirm=0.9", "konfirm"),
    ],
)
def test_what_cannot_be_varied_is_refused(recording, vary, message, capsys, monkeypatch):
    detections, truth = map(str, recording)
    files = [detections, detections, "--truth", truth, "--truth", truth]
    monkeypatch.setattr("sys.argv", ["twinscrew", "track", *files, "--vary", vary])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code != 0
    assert message in capsys.readouterr().err


def test_every_sensor_may_be_left_out(recording):
    records = read_records(recording[0])
    for sensors in (["lidar"], ["radar"], ["lidar", "eo"], ["lidar", "radar", "ir", "eo"]):
        frames = list(track(records, sensors, autoferry_settings()))
        assert len(frames[-1].tracks) >= 1


def test_the_delays_of_the_sensors_are_made_up_for(recording):
    """The plain tracker lags by what it does not know; the boat's does not."""
    records, truth = read_records(recording[0]), read_truth(recording[1])
    settings, sensors = autoferry_settings(), ["lidar", "radar"]
    error = {
        name: scored(records, sensors, list(TRACKERS[name](records, sensors, settings)), truth)[
            "localisation_m2"
        ]
        for name in ("twinscrew", "nearest")
    }
    assert error["twinscrew"] < 0.7 * error["nearest"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1]", "record 0 is none of"),
        ("{}", "expected a list"),
        ("no", "no JSON"),
        ('[{"sensorID": 9, "ownshipPosition": [0, 0], "time": 1, "measurement": []}]', "record 0"),
        ('[{"sensorID": 1, "ownshipPosition": [0, 0], "time": 1, "measurement": [1]}]', "record 0"),
        (
            '[{"sensorID": 1, "ownshipPosition": [0, NaN], "time": 1, "measurement": []}]',
            "not finite",
        ),
    ],
)
def test_a_bad_file_is_refused_by_name(tmp_path, text, message):
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message) as error:
        read_records(file)
    assert "bad.json" in str(error.value)


def test_gospa_of_exact_tracks_is_nothing_and_of_none_is_the_cutoff():
    targets = np.array([[0.0, 0.0], [50.0, 0.0]])
    assert gospa(targets, targets[::-1]).squared_m2 == 0.0
    assert math.sqrt(gospa(targets, np.empty((0, 2))).squared_m2) == pytest.approx(20.0)
    one_false = gospa(targets, np.vstack([targets, [[200.0, 0.0]]]))
    assert (one_false.missed, one_false.false, one_false.squared_m2) == (0, 1, 200.0)


def test_the_nees_is_the_error_in_standard_deviations_squared():
    score = TrackScore()
    for _ in range(3):
        score.add_nees("radar", [np.zeros(2)], [(np.array([2.0, 0.0]), 4.0 * np.eye(2))])
    score.add_nees("radar", [np.zeros(2)], [(np.array([0.0, 6.0]), 4.0 * np.eye(2))])
    score.add_nees("eo", [np.zeros(2)], [(np.array([1.0, 0.0]), np.zeros((2, 2)))])
    assert score.figures()["nees"] == {"radar": {"mean": 3.0, "in_95_band": 0.75}}


places = st.lists(st.tuples(st.floats(-60, 60), st.floats(-60, 60)), max_size=4)


@given(places, places, places)
def test_gospa_is_a_metric(a, b, c):
    x, y, z = (np.array(p, float).reshape(-1, 2) for p in (a, b, c))

    def distance(p, q):
        return math.sqrt(gospa(p, q).squared_m2)

    assert distance(x, x) == 0.0
    assert distance(x, y) == pytest.approx(distance(y, x))
    assert distance(x, z) <= distance(x, y) + distance(y, z) + 1e-9


def test_a_target_that_changes_its_track_counts_as_a_switch():
    score = TrackScore()
    for t, name in enumerate((1, 1, 2, 2)):
        score.add(float(t), {7: np.zeros(2)}, {name: np.ones(2)})
    score.add(4.0, {7: np.zeros(2)}, {9: np.full(2, 100.0)})
    figures = score.figures()
    assert figures["identity_switches"] == 1
    assert figures["time_to_first_track_s"] == {"7": 0.0}
    assert figures["false_tracks_per_minute"] == pytest.approx(15.0)

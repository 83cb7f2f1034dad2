"""Two judges of the rules of the road, on encounters that are drawn by hand."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.harness.commands import twinscrew

from twinscrew.hil_sim.rules import geometric, temporal
from twinscrew.hil_sim.rules.compare import Case, answer, gather, matched
from twinscrew.hil_sim.rules.evidence import STEP_S, Body, Tracks, read_tracks, write_tracks
from twinscrew.hil_sim.rules.pages import draw_pages
from twinscrew.runtime.errors import ConfigError, RecordingError

TIMES = np.arange(0.0, 40.0, STEP_S)
JUDGES = [pytest.param(geometric.judge, id="A"), pytest.param(temporal.judge, id="B")]


def way(start, course_deg, speed, turns=()):
    """A vessel's poses: at each of `turns`, (s, deg), it begins to steer another course."""
    course = np.full(len(TIMES), np.radians(course_deg))
    for begin_s, to_deg in turns:
        after = begin_s <= TIMES
        change = np.radians(to_deg) - course[after][0]
        most = np.minimum(abs(change), 0.3 * (TIMES[after] - begin_s))
        course[after] = course[after][0] + np.sign(change) * most
    steps = STEP_S * speed * np.exp(1j * course)
    place = complex(*start) + np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    return np.column_stack([place.real, place.imag, course])


def meeting(own, *others, length_m=5.0, beam_m=2.5, circle=True, **own_facts) -> Tracks:
    bodies = [
        Body(name="own", length_m=5.0, beam_m=2.5, circle=True, ours=True, **own_facts),
        *(
            Body(name=f"other {k}", length_m=length_m, beam_m=beam_m, circle=circle)
            for k in range(len(others))
        ),
    ]
    return Tracks(
        times=TIMES,
        pose_N=np.stack([own, *others], axis=1),
        bodies=tuple(bodies),
        fixed=np.empty((0, 3)),
    )


HEAD_ON = ((100, 1), 180, 2.5)
FROM_STARBOARD = ((50, 50), 270, 2.5)
FROM_PORT = ((52, -50), 90, 2.5)
# own turns, the other, its role, whether it was kept
CASES = {
    "head-on, to starboard": ([(11, 50), (16, 0)], HEAD_ON, "head_on", True),
    "head-on, to port": ([(11, -50), (16, 0)], HEAD_ON, "head_on", False),
    "head-on, nothing": ([], HEAD_ON, "head_on", False),
    "gives way astern": ([(11, 60), (17, 0)], FROM_STARBOARD, "give_way", True),
    "crosses ahead": ([(6, -50), (17, 0)], ((50, 50), 270, 2.2), "give_way", False),
    "stands on, then acts": ([(14, 60)], FROM_PORT, "stand_on", True),
    "does not stand on": ([(8, 50)], FROM_PORT, "stand_on", False),
    "turns to port at last": ([(14, -60)], FROM_PORT, "stand_on", False),
    "stands on into it": ([], FROM_PORT, "stand_on", False),
    "overtakes clear": ([(5, 40), (10, 0)], ((25, 0), 0, 1.0), "overtaking", True),
    "overtakes through it": ([], ((25, 0), 0, 1.0), "overtaking", False),
}


@pytest.mark.parametrize("judge", JUDGES)
@pytest.mark.parametrize("name", CASES)
def test_both_judges_see_what_a_mariner_would(name, judge) -> None:
    turns, other, role, kept = CASES[name]
    (found,) = judge(meeting(way((0, 0), 0, 2.5, turns), way(*other)))
    assert (found.role, found.kept) == (role, kept), found.why
    assert bool(found.why) is not kept


@pytest.mark.parametrize("judge", JUDGES)
def test_a_verdict_does_not_depend_on_where_north_is(judge) -> None:
    turns, other, *_ = CASES["crosses ahead"]
    tracks = meeting(way((0, 0), 0, 2.5, turns), way(*other))
    (found,) = judge(tracks)
    pose, angle = tracks.pose_N.copy(), 2.1
    c, s = np.cos(angle), np.sin(angle)
    pose[..., :2] = pose[..., :2] @ np.array([[c, s], [-s, c]]) + [300.0, -70.0]
    pose[..., 2] += angle
    (turned,) = judge(Tracks(times=TIMES, pose_N=pose, bodies=tracks.bodies, fixed=tracks.fixed))
    assert (turned.role, turned.kept, turned.why) == (found.role, found.kept, found.why)
    assert turned.closest_m == pytest.approx(found.closest_m, abs=1e-6)


@pytest.mark.parametrize("judge", JUDGES)
def test_a_small_late_alteration_is_not_readable(judge) -> None:
    early = meeting(way((0, 0), 0, 2.5, [(9, 50), (17, 0)]), way(*FROM_STARBOARD))
    (found,) = judge(early)
    assert found.readable
    assert found.altered_deg == pytest.approx(50.0, abs=2.0)
    late = meeting(way((0, 0), 0, 2.5, [(9, 20), (19, 0)]), way(*FROM_STARBOARD))
    (found,) = judge(late)
    assert found.readable is False


@pytest.mark.parametrize("judge", JUDGES)
def test_who_passes_far_off_or_lies_at_anchor_meets_nobody(judge) -> None:
    own = way((0, 0), 0, 2.5)
    assert judge(meeting(own, way((100, 30), 180, 2.5))) == ()
    assert judge(meeting(own, way((50, 0), 0, 0.0))) == ()


@pytest.mark.parametrize("judge", JUDGES)
def test_a_long_ship_is_near_where_its_hull_is(judge) -> None:
    """Past its middle 9 m off, along its side: 4 m from its hull, 2.8 m of which are ours."""
    ship = way((60, 9.0), 180, 2.0)
    (found,) = judge(meeting(way((0, 0), 0, 2.5), ship, length_m=20.0, beam_m=6.0, circle=False))
    assert found.closest_m == pytest.approx(9.0 - 3.0 - 2.795, abs=0.15)


def test_what_was_possible_is_said_where_a_rule_was_broken() -> None:
    (free,) = geometric.judge(meeting(way((0, 0), 0, 2.5), way(*FROM_STARBOARD)))
    assert not free.kept
    assert free.possible
    # Vessels beside and behind it, as fast as it is: whatever it does, it touches one.
    around = [way(place, 0, 2.5) for place in ((0, 6), (0, -6), (-6, 0), (-6, 6), (-6, -6))]
    (found, *_) = (
        one
        for one in geometric.judge(meeting(way((0, 0), 0, 2.5), way(*FROM_STARBOARD), *around))
        if one.other == 1
    )
    assert found.possible is False


def test_findings_of_one_meeting_are_compared_and_the_rest_is_listed() -> None:
    tracks = meeting(way((0, 0), 0, 2.5), way(*FROM_STARBOARD))
    case = Case("a", "here", tracks)
    first, second = geometric.judge(tracks), temporal.judge(tracks)
    (both,) = matched(case, first, second)
    assert both.agreed
    (alone,) = matched(case, first, [])
    assert not alone.agreed
    assert "only A" in alone.difference
    said = answer([both, alone], 1)
    assert said["agreement"]["overall"]["count"] == 1
    assert said["agreement"]["by_rule"]["15"]["of"] == 2
    assert [one["reason"] for one in said["differences"]] == [alone.difference]


def test_tracks_come_back_to_the_centimetre(tmp_path: Path) -> None:
    tracks = meeting(way((0, 0), 0, 2.5), way(*FROM_STARBOARD))
    tracks.pose_N[:7, 1] = np.nan
    write_tracks(tmp_path, tracks)
    again = read_tracks(tmp_path / "tracks.json")
    np.testing.assert_allclose(again.pose_N[..., :2], tracks.pose_N[..., :2], atol=0.0051)
    assert np.isnan(again.pose_N[:7, 1]).all()
    assert again.bodies == tracks.bodies


@pytest.mark.parametrize(
    "content",
    [b"", b"{}", b"[1]", b"\xff", b'{"step_s":0.2,"bodies":[],"tracks":[[1,2,3]]}', b"{" * 90000],
)
def test_a_damaged_file_of_tracks_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "tracks.json"
    file.write_bytes(content)
    with pytest.raises(RecordingError, match=r"tracks\.json: no tracks"):
        list(gather(tmp_path))


def test_what_cannot_be_judged_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        list(gather(tmp_path / "gone"))
    with pytest.raises(ConfigError, match="--tracks"):
        list(gather(tmp_path, "guess"))
    with pytest.raises(RecordingError, match="holds no recording"):
        list(gather(tmp_path))
    with pytest.raises(RecordingError, match="nobody knows the truth"):
        list(gather(tmp_path, "truth"))
    with pytest.raises(ConfigError, match=r"FILE\.pdf or a folder"):
        draw_pages(tmp_path / "pages.docx", [])


def test_the_command_prints_one_object_and_draws_every_encounter(tmp_path: Path) -> None:
    turns, other, *_ = CASES["gives way astern"]
    write_tracks(tmp_path, meeting(way((0, 0), 0, 2.5, turns), way(*other)))
    result = twinscrew("judge", tmp_path, "--json", "--pages", tmp_path / "pages")
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    assert said["encounters"] == 1
    assert said["verdicts"][0]["a"]["rate"] == 1.0
    assert [Path(file).read_bytes()[:4] for file in said["pages"]] == [b"\x89PNG"]
    result = twinscrew("judge", tmp_path, "--pages", tmp_path / "all.pdf")
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "all.pdf").read_bytes().startswith(b"%PDF")

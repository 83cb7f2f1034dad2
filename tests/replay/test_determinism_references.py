"""The decisions are the accepted ones; a change is shown field by field before it is accepted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.replay import accept, references
from tests.replay.differences import differences, summary
from tests.replay.references import CASES, decide, machine, sha256, store, stored

from twinscrew.runtime.messages import cdr
from twinscrew.runtime.safety.events import LIDAR_STALE, OVERRUN

ACCEPT = (
    "if these are meant: make accept (python -m tests.replay.accept), and commit the references"
)


@pytest.fixture(scope="module")
def decisions() -> tuple[bytes, ...]:
    return decide("apf")


def changed(decisions: tuple[bytes, ...], index: int, **fields: object) -> tuple[bytes, ...]:
    decision = replace(cdr.decode_decision(decisions[index]), **fields)
    return (*decisions[:index], cdr.encode_decision(decision), *decisions[index + 1 :])


def told(old: tuple[bytes, ...], new: tuple[bytes, ...], *, exact: bool) -> list[str]:
    return [str(difference) for difference in differences(old, new, exact=exact)]


@pytest.mark.parametrize("case", CASES)
def test_the_decisions_are_the_accepted_ones(case: str) -> None:
    found = accept.compare(case, decide(case))
    assert not found, "\n".join((*summary(found), ACCEPT))


def test_a_difference_names_the_decision_the_field_and_both_values(
    decisions: tuple[bytes, ...],
) -> None:
    before = cdr.decode_decision(decisions[20]).thrust
    after = changed(decisions, 20, thrust=before + np.array([0.0, 0.5]), arrived=True)
    assert told(decisions, after, exact=True) == [
        f"decision 20: thrust[1]: {before[1]} -> {before[1] + 0.5}",
        "decision 20: arrived: False -> True",
    ]


def test_the_last_bit_counts_on_the_same_machine_and_not_on_another(
    decisions: tuple[bytes, ...],
) -> None:
    before = cdr.decode_decision(decisions[20]).thrust
    after = changed(decisions, 20, thrust=np.nextafter(before, np.inf))
    assert len(told(decisions, after, exact=True)) == 2
    assert not told(decisions, after, exact=False)
    gone_far = changed(decisions, 20, thrust=before + 1.0)
    assert len(told(decisions, gone_far, exact=False)) == 2


def test_the_summary_tells_of_each_field_where_it_begins_and_the_greatest_change(
    decisions: tuple[bytes, ...],
) -> None:
    early, late = (cdr.decode_decision(decisions[k]).thrust for k in (10, 20))
    after = changed(decisions, 20, thrust=late - 2.0, arrived=True)
    after = changed(after, 10, thrust=early + np.array([0.5, 0.0]))
    assert list(summary(list(differences(decisions, after, exact=True)))) == [
        f"thrust: in 2 decisions, by 2 at most; first decision 10: thrust[0]: "
        f"{early[0]} -> {early[0] + 0.5}",
        "arrived: in 1 decisions; first decision 20: arrived: False -> True",
    ]


def test_a_lost_track_is_a_difference_on_every_machine(decisions: tuple[bytes, ...]) -> None:
    decision = cdr.decode_decision(decisions[-1])
    tracks = decision.tracks
    assert tracks.id.size
    none = replace(
        tracks,
        **{name: getattr(tracks, name)[:0] for name in ("id", "p_N", "v_N", "radius")},
        covariance=tracks.covariance[:0],
        age_s=tracks.age_s[:0],
    )
    found = told(decisions, changed(decisions, len(decisions) - 1, tracks=none), exact=False)
    assert any("tracks.id: (1,) array -> (0,) array" in line for line in found)


def test_events_are_told_by_name_and_detail(decisions: tuple[bytes, ...]) -> None:
    after = changed(decisions, 9, events=(OVERRUN.at(1, "12 ms"), LIDAR_STALE.at(1)))
    assert told(decisions, after, exact=False) == [
        "decision 9: events: [] -> ['overrun (12 ms)', 'lidar_stale']"
    ]


def test_a_missing_decision_is_a_difference(decisions: tuple[bytes, ...]) -> None:
    (found,) = told(decisions, decisions[:-1], exact=False)
    assert f"number of decisions: {len(decisions)} -> {len(decisions) - 1}" in found


def test_a_reference_keeps_every_bit_and_says_where_it_was_made(
    decisions: tuple[bytes, ...], tmp_path: Path
) -> None:
    assert stored("apf", tmp_path) is None
    store("apf", decisions, tmp_path)
    store("apf", decisions[:3], tmp_path)  # the new one replaces the old one
    reference = stored("apf", tmp_path)
    assert reference is not None
    assert sha256(reference.decisions) == sha256(decisions[:3])
    assert reference.machine == machine()
    assert {"cpu", "libc", "software"} <= set(reference.machine)


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The command, working on a store of its own with one stale reference."""
    for case in CASES:
        store(case, decide(case), tmp_path)
    store("apf", changed(decide("apf"), 4, arrived=True), tmp_path)
    monkeypatch.setattr(accept, "stored", lambda case: stored(case, tmp_path))
    monkeypatch.setattr(accept, "store", lambda case, found: store(case, found, tmp_path))
    return tmp_path


def test_checking_shows_the_difference_and_renews_nothing(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert accept.main(["--check"]) == 1
    assert "decision 4: arrived: True -> False" in capsys.readouterr().out
    assert accept.main(["--check"]) == 1


@pytest.mark.slow
def test_without_a_yes_nothing_is_renewed(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda question: "n")
    assert accept.main([]) == 1
    assert accept.main(["--check"]) == 1


def test_accepting_shows_the_difference_first_and_then_renews_what_changed(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    untouched = min((copy / "ac_iqn").iterdir()).stat().st_mtime_ns
    assert accept.main(["--yes"]) == 0
    out = capsys.readouterr().out
    assert out.index("decision 4: arrived: True -> False") < out.index("renewed")
    assert out.rstrip().endswith(": apf")
    assert accept.main(["--check"]) == 0
    assert min((copy / "ac_iqn").iterdir()).stat().st_mtime_ns == untouched


def test_a_machine_that_differs_is_compared_as_another_one(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(accept, "machine", lambda: {**machine(), "cpu": "another"})
    before = cdr.decode_decision(decide("apf")[20]).thrust
    store("apf", changed(decide("apf"), 20, thrust=np.nextafter(before, np.inf)), copy)
    assert accept.main(["--check"]) == 0
    assert "as another machine can" in capsys.readouterr().out


def test_a_case_without_a_reference_says_how_to_make_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(accept, "stored", lambda case: references.stored(case, tmp_path))
    with pytest.raises(LookupError, match=r"tests\.replay\.accept makes it"):
        accept.compare("apf", ())

"""docs/safety.md is true: its events and states are the code's."""

import re
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from twinscrew.runtime.safety import events
from twinscrew.runtime.safety.events import GREATEST_DETAIL, LIDAR_STALE, EventKind
from twinscrew.runtime.vessel.health import State

ROOT = Path(__file__).parents[3]
DOC = (ROOT / "docs" / "safety.md").read_text()


def section(title: str) -> str:
    return DOC.split(f"## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> list[list[str]]:
    lines = [line for line in section(title).splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells[1:] if not set(row[0]) <= {"-"}]


def test_every_event_of_the_code_is_in_the_table_and_no_other() -> None:
    documented = {row[0].strip("`"): row[1] for row in rows("Events")}
    assert documented == {name: kind.severity.value for name, kind in events.KINDS.items()}


def test_an_events_name_is_its_constants_and_its_meaning_a_sentence() -> None:
    for constant, kind in vars(events).items():
        if isinstance(kind, EventKind):
            assert kind.name == constant.lower()
            assert kind.meaning.endswith(".")


def test_every_state_is_in_the_table_and_no_other() -> None:
    assert [row[0].strip("`") for row in rows("States")] == [state.value for state in State]


def test_events_in_running_text_are_events() -> None:
    words = set(re.findall(r"`([a-z]+_[a-z_]+)`", DOC))
    settings = {"max_message_mb", "command_rate_hz", "accept_parameters"}
    tests = {word for word in words if word.startswith("test_")}
    assert words - tests - settings <= set(events.KINDS)


@given(st.text(st.characters(codec=None)))
def test_a_detail_is_cut_and_can_be_written_whatever_it_says(detail: str) -> None:
    told = LIDAR_STALE.at(1, 50 * detail).detail
    assert len(told) <= GREATEST_DETAIL
    assert told == told.encode("utf-8").decode("utf-8")


def test_a_short_detail_stays_as_it_is_and_a_cut_one_shows_it() -> None:
    assert LIDAR_STALE.at(1, "0.45 s old").detail == "0.45 s old"
    assert LIDAR_STALE.at(1, "x" * 1000).detail.endswith("x ...")
    assert LIDAR_STALE.at(1, "a\udc80b").detail == "a?b"

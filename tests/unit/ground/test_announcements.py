"""What health events sound like to a ground station."""

from twinscrew.runtime.ground.report import AGAIN_S, AT_ONCE, Announcements, words_of
from twinscrew.runtime.messages.types import Severity
from twinscrew.runtime.safety import events as safety_events
from twinscrew.runtime.safety.events import GOAL_SET, LIDAR_STALE, STATE


def said(announcements: Announcements) -> list[str]:
    texts = []
    while one := announcements.take():
        texts += [text for text, _ in one]
    return texts


def test_an_event_is_told_by_what_it_means_not_by_its_name() -> None:
    event = LIDAR_STALE.at(0, "0.45 s old")
    assert words_of(event) == (
        "No scan that can be used for too long: neutral thrust. (0.45 s old)"
    )
    assert words_of(GOAL_SET.at(0)) == "A new goal was accepted."


def test_an_event_is_told_with_its_severity_one_at_a_time() -> None:
    announcements = Announcements()
    announcements.happened((LIDAR_STALE.at(0), GOAL_SET.at(0)), 1.0)
    assert announcements.take() == [(LIDAR_STALE.meaning, Severity.ERROR)]
    assert announcements.take() == [(GOAL_SET.meaning, Severity.INFO)]
    assert announcements.take() == []


def test_the_same_is_not_said_again_too_soon_but_something_else_of_it_is() -> None:
    announcements = Announcements()
    for now_s in (0.0, 1.0, AGAIN_S - 0.1):
        announcements.happened((GOAL_SET.at(0, "north 1.0 m"),), now_s)
    announcements.happened((GOAL_SET.at(0, "north 2.0 m"),), 2.0)
    assert len(said(announcements)) == 2
    announcements.happened((GOAL_SET.at(0, "north 1.0 m"),), AGAIN_S)
    assert len(said(announcements)) == 1


def test_the_autopilots_own_words_are_not_given_back_to_it() -> None:
    announcements = Announcements()
    announcements.happened((safety_events.AUTOPILOT_SAYS.at(0, "Throttle armed"),), 0.0)
    announcements.happened((STATE.at(0, "ready"),), 0.0)
    assert said(announcements) == []


def test_a_flood_of_events_does_not_become_a_flood_of_texts() -> None:
    announcements = Announcements()
    announcements.happened([GOAL_SET.at(0, f"north {k} m") for k in range(1000)], 0.0)
    assert len(said(announcements)) == AT_ONCE


def test_every_event_has_words_that_are_no_name() -> None:
    for kind in safety_events.KINDS.values():
        words = words_of(kind.at(0))
        assert "_" not in words
        assert words.endswith(".")

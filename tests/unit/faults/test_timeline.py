from twinscrew.hil_sim.faults.timeline import Span, Timeline, spans

LINE = Timeline("", (1.0, "a"), (2.0, "b"), (3.0, "b"), (4.0, "a"))


def test_only_changes_are_remembered() -> None:
    assert LINE.changes(0.0, 9.0) == [1.0, 2.0, 4.0]
    assert LINE.changes(1.0, 2.0) == [2.0]
    assert LINE.last == "a"


def test_what_it_was_lasts_from_a_change_to_the_next() -> None:
    times = (0.9, 1.0, 1.9, 2.0, 3.9, 4.0, 99.0)
    assert [LINE.at(t) for t in times] == ["", "a", "a", "b", "b", "a", "a"]


def test_a_span_is_cut_off_where_one_looks_no_more() -> None:
    def is_a(time_s: float) -> bool:
        return LINE.at(time_s) == "a"

    assert spans(is_a, [LINE], 0.0, 9.0) == [(1.0, 2.0), (4.0, 9.0)]
    assert spans(is_a, [LINE], 1.5, 4.0) == [(1.5, 2.0)]
    assert spans(is_a, [LINE], 2.5, 3.5) == []


def test_a_change_that_changes_nothing_about_it_does_not_end_a_span() -> None:
    other = Timeline(0, (4.5, 1), (5.0, 2))
    assert spans(lambda t: other.at(t) > 0, [LINE, other], 0.0, 9.0) == [Span(4.5, 9.0)]


def test_a_span_has_a_length() -> None:
    assert Span(1.5, 4.0).length_s == 2.5


def test_a_span_holds_its_ends_and_what_lies_between() -> None:
    span = Span(1.0, 2.0)
    assert [span.holds(t) for t in (0.9, 1.0, 1.5, 2.0, 2.1)] == [False, True, True, True, False]

import math

from twinscrew.hil_sim.report.markdown import interval, number, p_value, share, table


def test_a_table_has_a_line_for_the_header_one_below_it_and_one_a_row() -> None:
    lines = table(["a", "b"], [["1", "x|y"], ["2", ""]]).splitlines()
    assert lines == ["| a | b |", "| --- | --- |", "| 1 | x\\|y |", "| 2 |  |"]


def test_what_is_not_there_is_a_dash() -> None:
    assert number(None) == number(math.nan) == interval(math.nan, math.nan) == share(0, 0) == "-"


def test_figures_are_rounded_and_shares_keep_their_counts() -> None:
    assert number(1.256) == "1.26"
    assert interval(1.0, 2.126) == "1.00 .. 2.13"
    assert share(47, 50) == "94 % (47/50)"
    assert (p_value(0.0004), p_value(0.04321)) == ("< 0.001", "0.043")

"""The success figure: its words, and its intervals at the top."""

from pathlib import Path

import pytest
from tests.unit.report.results_folder import folder, made_up

from twinscrew.hil_sim.experiments.plan import SetSettings
from twinscrew.hil_sim.report.bars import success_figure, words
from twinscrew.hil_sim.report.material import gather


def test_sets_are_named_in_words(tmp_path: Path) -> None:
    figure = success_figure(gather(folder(tmp_path / "out", made_up())))
    names = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert names == ["3 vessels,\nno buoys", "5 vessels,\n4 buoys"]


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (SetSettings(name="one", vessels=1, buoys=1), "1 vessel,\n1 buoy"),
        (SetSettings(name="my own set"), "my own set"),
    ],
)
def test_a_set_that_does_not_say_what_is_in_it_keeps_its_name(one: SetSettings, said: str) -> None:
    assert words(one) == said


def test_the_interval_of_a_rate_of_100_percent_is_seen_whole_and_named(tmp_path: Path) -> None:
    material = gather(folder(tmp_path / "out", made_up()))
    axes = success_figure(material).axes[0]
    assert 100.0 in {bar.get_height() for bar in axes.patches}, "some method never failed"
    _, top = axes.get_ylim()
    ends = [end for errors in axes.collections for line in errors.get_segments() for end in line]
    assert max(height for _, height in ends) == pytest.approx(100.0)
    assert top > 100.0
    named = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "95 % interval (Wilson)" in named

from pathlib import Path

import pytest

from twinscrew.hil_sim.experiments.plan import load_sets
from twinscrew.runtime.errors import ConfigError


def test_the_papers_sets_are_six_with_a_travel_time_for_every_method() -> None:
    paper = load_sets("paper")
    sizes = [(one.vessels, one.buoys) for one in paper.set]
    assert sizes == [(3, 0), (4, 0), (5, 0), (5, 2), (5, 3), (5, 4)]
    assert len(paper.published_travel_time_s) == 8
    assert paper.published_travel_time_s["ac_iqn"][0] == 17.22


def test_a_set_draws_what_it_says() -> None:
    scenario = load_sets("paper").set[5].draw(seed=4)
    assert (scenario.vessels, len(scenario.buoys)) == (5, 4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "set"),
        ('[[set]]\nname = "a"\n[[set]]\nname = "a"\n', "same name"),
        ('[[set]]\nname = "a"\nbuoys = 1000000000000\n', r"buoys: .*<= 50"),
        ('[[set]]\nname = "a"\nboats = 3\n', "unknown key"),
        ('[[set]]\nname = "a"\nscenario = "no_such"\n', "set 'a'.*no_such"),
        ('[[set]]\nname = "a"\nvessels = 20\nbuoys = 50\n', "set 'a'.*no place found"),
        ('[[set]]\nname = "a"\n[published_travel_time_s]\napf = [1.0, 2.0]\n', "2 travel times"),
    ],
)
def test_a_file_that_cannot_be_sailed_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "sets.toml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_sets(file)


def test_an_unknown_set_names_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"'no_such' is not one of .*'paper'"):
        load_sets("no_such")

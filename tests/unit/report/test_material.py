import json
import math
from pathlib import Path

import pytest
from tests.unit.report.results_folder import SETS, folder, made_up

from twinscrew.hil_sim.report.material import gather
from twinscrew.runtime.errors import ConfigError

SCORE = {"success_rate": 0.9, "episodes": 100, "travel_time_s": 18.5}


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return folder(tmp_path / "out", made_up())


def test_cells_are_found_by_method_set_and_variant_and_pooled_over_sets(out: Path) -> None:
    material = gather(out)
    assert set(material.cells) == {(m, s, "full") for m in ("ac_iqn", "apf") for s in SETS}
    pooled = material.pooled["apf", "full"]
    assert (pooled.episodes, pooled.successes) == (6, 2)


def test_the_papers_travel_times_are_found_by_method_and_set(out: Path) -> None:
    published = gather(out).published
    assert published["ac_iqn", "3 rob 0 obs"] == 17.22
    assert published["mpc", "5 rob 4 obs"] == 33.61
    assert math.isnan(published["rainbow", "5 rob 4 obs"])


def test_an_episodes_line_is_where_it_stands_in_the_file(out: Path) -> None:
    material = gather(out)
    lines = (out / "results.jsonl").read_text().splitlines()
    for record in material.records:
        assert json.loads(lines[material.line_of(record) - 1])["episode"] == record.episode
    assert [material.line_of(record) for record in material.records] == list(range(1, 13))


def test_a_training_evaluation_is_read_set_by_set(out: Path, tmp_path: Path) -> None:
    file = tmp_path / "scores.json"
    rows = [SCORE, {**SCORE, "success_rate": 0.0, "travel_time_s": None}]
    file.write_text(json.dumps({"settings": rows}))
    first, second = gather(out, [f"apf={file}"]).trained["apf"]
    assert (first.success_rate, first.travel_time_s) == (0.9, 18.5)
    assert math.isnan(second.travel_time_s)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (json.dumps({"settings": [SCORE]}), "1 settings, the experiment 2 sets"),
        (json.dumps(SCORE), "not what `twinscrew evaluate"),
        (json.dumps({"settings": [{"episodes": 3}, SCORE]}), "not what `twinscrew evaluate"),
        ("[", "not what `twinscrew evaluate"),
    ],
)
def test_an_evaluation_that_does_not_fit_is_refused(out, tmp_path: Path, text, words) -> None:
    file = tmp_path / "scores.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match=words):
        gather(out, [f"apf={file}"])


@pytest.mark.parametrize(("text", "words"), [("x", "METHOD=FILE"), ("a=no/x.json", "No such")])
def test_an_evaluation_that_is_not_there_is_refused(out: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        gather(out, [text])


def test_a_folder_without_an_episode_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no episode has been sailed"):
        gather(folder(tmp_path / "out", []))

"""What is missing is sailed, what is there is kept, and the progress tells both."""

from pathlib import Path

import pytest

from twinscrew.hil_sim.experiments.plan import Experiment, SetSettings, parse_methods
from twinscrew.hil_sim.experiments.results import begin, go_on
from twinscrew.hil_sim.experiments.runner import count, run
from twinscrew.runtime.errors import PolicyError


def asked(**changes) -> Experiment:
    sets = (SetSettings(name="head on", scenario="head_on"),)
    return Experiment(
        **{"methods": parse_methods("ac_iqn"), "sets": sets, "episodes": 1, "seed": 3, **changes}
    )


@pytest.mark.slow
def test_progress_begins_with_what_was_there_before(tmp_path: Path) -> None:
    folder, told = tmp_path / "out", []
    begin(folder, asked())
    first = run(asked(), folder, 1, progress=lambda *numbers: told.append(numbers))
    assert (first.kept, told) == (0, [(0, 1), (1, 1)])
    grown = go_on(folder, {"episodes": 2}).experiment
    told.clear()
    whole = run(grown, folder, 1, progress=lambda *numbers: told.append(numbers))
    assert (whole.kept, told) == (1, [(1, 2), (2, 2)])
    assert whole.records[0] == first.records[0]
    assert count(grown) == len(whole.records) == 2


def test_a_policy_that_changed_is_refused_before_anything_is_sailed(tmp_path: Path) -> None:
    (method,) = parse_methods("apf")
    changed = asked(methods=(type(method)(name="apf", policy="apf", sha256="0" * 64),))
    begin(tmp_path / "out", changed)
    with pytest.raises(PolicyError, match="has changed since"):
        run(changed, tmp_path / "out", 1)
    assert not (tmp_path / "out" / "results.jsonl").exists()

from typing import Any

import numpy as np
import pytest

from twinscrew.hil_sim.bench import assurance as bench
from twinscrew.runtime.safety.assurance import Assurance
from twinscrew.runtime.safety.prediction import Foresight


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many predictions each check made."""
    counts: list[int] = []
    judge, step = Foresight.judge, Assurance.step

    def counted_judge(self: Foresight, *arguments: Any) -> Any:
        counts[-1] += 1
        return judge(self, *arguments)

    def counted_step(self: Assurance, *arguments: Any, **named: Any) -> Any:
        counts.append(0)
        return step(self, *arguments, **named)

    monkeypatch.setattr(Foresight, "judge", counted_judge)
    monkeypatch.setattr(Assurance, "step", counted_step)
    return counts


def test_the_situations_are_what_their_names_say(
    judged: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "SCANS", 2)
    figures = bench.run()["assurance"]
    assert list(figures) == list(bench.SITUATIONS)
    nothing, clear, wait, intervene, hemmed = np.array(judged).reshape(-1, 2)[:, 0].tolist()
    assert (nothing, clear, wait) == (0, 1, 2)
    assert intervene > wait
    assert hemmed == 11  # the command, five ways out later, five ways out now: never more

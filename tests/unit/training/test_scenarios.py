"""Rows of the schedule: what may be asked for."""

import pytest

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.training.scenarios import ScenarioSettings


def test_more_buoys_than_could_ever_be_placed_are_refused_at_once():
    with pytest.raises(ConfigError, match=r"buoys: .*<= 50, got 1000000"):
        convert({"buoys": 1_000_000}, ScenarioSettings)

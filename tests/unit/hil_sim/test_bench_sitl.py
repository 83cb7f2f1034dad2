"""What `bench --only sitl` tells apart."""

import cProfile
import pstats
from pathlib import Path

import pytest

from twinscrew.hil_sim.bench.sitl import PARTS, _spent
from twinscrew.runtime.settings import CONFIG_DIR


@pytest.mark.parametrize("part", PARTS)
def test_the_functions_of_every_part_are_where_they_are_said_to_be(part: str) -> None:
    for file, function in PARTS[part]:
        assert f"    def {function}(" in (text := (CONFIG_DIR.parent / file).read_text()) or (
            f"\ndef {function}(" in text
        )


def outer() -> int:
    return inner() + sum(range(2000))


def inner() -> int:
    return sum(range(20_000))


def test_a_functions_time_is_with_all_it_calls() -> None:
    profile = cProfile.Profile()
    profile.runcall(outer)
    stats = pstats.Stats(profile).stats
    here = Path(__file__).name
    assert _spent(stats, here, "outer") > _spent(stats, here, "inner") > 0.0
    assert _spent(stats, here, "no_such") == 0.0

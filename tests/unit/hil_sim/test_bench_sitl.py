"""What `bench --only sitl` tells apart."""

import pytest

from twinscrew.hil_sim.bench.sitl import PARTS
from twinscrew.runtime.settings import CONFIG_DIR


@pytest.mark.parametrize("part", PARTS)
def test_the_functions_of_every_part_are_where_they_are_said_to_be(part: str) -> None:
    for file, function in PARTS[part]:
        assert f"    def {function}(" in (text := (CONFIG_DIR.parent / file).read_text()) or (
            f"\ndef {function}(" in text
        )

import gc
import weakref

import pytest

from twinscrew.runtime.app.garbage import EVERY_S, OLD_EVERY, Garbage


class Knot:
    """Something that only the collector can free."""

    def __init__(self) -> None:
        self.itself = self


def test_inside_it_the_collector_runs_only_when_told_to() -> None:
    with Garbage() as garbage:
        garbage.collect(0.0)
        knot = weakref.ref(Knot())
        for _ in range(20_000):
            Knot()
        assert knot() is not None
        assert not garbage.collect(0.5 * EVERY_S)
        assert knot() is not None
        assert garbage.collect(EVERY_S)
        assert knot() is None


def test_what_grew_old_is_collected_in_the_end() -> None:
    with Garbage() as garbage:
        knot = Knot()
        watched = weakref.ref(knot)
        for second in range(3):
            garbage.collect(second * EVERY_S)
        del knot
        garbage.collect(3 * EVERY_S)
        assert watched() is not None
        for second in range(4, OLD_EVERY + 1):
            garbage.collect(second * EVERY_S)
        assert watched() is None


@pytest.mark.parametrize("enabled", [True, False])
def test_afterwards_everything_is_as_before(enabled: bool) -> None:
    frozen = gc.get_freeze_count()
    if not enabled:
        gc.disable()
    try:
        with Garbage():
            assert not gc.isenabled()
            assert gc.get_freeze_count() > frozen
        assert gc.isenabled() is enabled
        assert gc.get_freeze_count() == frozen
    finally:
        gc.enable()

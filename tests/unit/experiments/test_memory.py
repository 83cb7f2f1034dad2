"""Nothing of an episode stays in a worker."""

import gc
import weakref

import numpy as np
import psutil

from twinscrew.hil_sim.experiments.episode import give_back


class Ring:
    """Refers to itself, and holds 8 MB in pieces too small for pages of their own."""

    def __init__(self) -> None:
        self.itself = self
        self.pieces = [np.ones(1000) for _ in range(1000)]


def test_rings_are_freed_and_their_memory_given_back() -> None:
    process = psutil.Process()
    gc.disable()
    try:
        rings = [Ring() for _ in range(8)]
        alive = [weakref.ref(ring) for ring in rings]
        before = process.memory_info().rss
        del rings
        assert all(ring() is not None for ring in alive)
        give_back()
        assert all(ring() is None for ring in alive)
        assert before - process.memory_info().rss > 32e6
    finally:
        gc.enable()

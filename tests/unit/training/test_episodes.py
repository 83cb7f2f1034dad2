"""Episodes are drawn ahead, and each slot gets its own."""

from __future__ import annotations

import numpy as np

from twinscrew.training.episodes import Pool


def test_a_pool_gives_every_slot_its_episodes_in_order_however_they_are_taken() -> None:
    asked: list[tuple[int, int]] = []

    def make(slots: np.ndarray, numbers: np.ndarray) -> tuple[np.ndarray]:
        asked.extend(zip(slots.tolist(), numbers.tolist(), strict=True))
        return (100 * slots + numbers,)

    pool = Pool(make, slots=3, depth=4)  # type: ignore[arg-type]
    taken: dict[int, list[int]] = {0: [], 1: [], 2: []}
    generator = np.random.default_rng(0)
    for _ in range(60):
        slots = np.flatnonzero(generator.random(3) < [0.9, 0.3, 0.1])
        if slots.size:
            for slot, value in zip(slots, pool.take(slots)[0], strict=True):
                taken[int(slot)].append(int(value))
    for slot, values in taken.items():
        assert values == [100 * slot + n for n in range(len(values))]
    assert len(asked) == len(set(asked))

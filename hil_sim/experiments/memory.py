"""Keep a worker as small after its thousandth episode as after its first."""

from __future__ import annotations

import ctypes
import gc


def give_back() -> None:
    """Free what an episode has left behind, and hand it back to the system.

    A crew lies in reference cycles: few objects, which the collector counts, that hold much native
    memory, which it does not see. And what many sessions have torn into pieces, the allocator keeps
    (glibc; others have no `malloc_trim`). Without both a worker grows by some MB an episode.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)

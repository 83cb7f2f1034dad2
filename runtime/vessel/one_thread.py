"""Imported first: the numerical libraries read, when they are loaded, how many threads to keep.

The runtime's matrices are too small for more than one thread, and idle ones of a pool would still
wake up now and then. Whoever sets the variables himself is left alone.
"""

from __future__ import annotations

import os
from typing import Final

VARIABLES: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

for _variable in VARIABLES:
    os.environ.setdefault(_variable, "1")

import numpy as np
from numpy.typing import NDArray

def gather_frd(
    data: NDArray[np.uint8],
    offsets: tuple[int, ...],
    shape: tuple[int, int],
    steps: tuple[int, int],
    points_S: NDArray[np.float32],
) -> None: ...

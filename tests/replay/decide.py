"""Decides on the stored recording in a process of its own, and prints the decisions' hash.

python -m tests.replay.decide CASE [ONNX_RUNTIME_THREADS]
"""

from __future__ import annotations

import sys
from typing import Any

import onnxruntime as ort
from tests.replay.references import decide, sha256


def use_threads(count: int) -> None:
    """Give ONNX Runtime more threads than the runtime allows it."""
    make = ort.InferenceSession

    def session(data: bytes, options: Any, **others: Any) -> Any:
        options.intra_op_num_threads = options.inter_op_num_threads = count
        options.execution_mode = ort.ExecutionMode.ORT_PARALLEL
        return make(data, options, **others)

    ort.InferenceSession = session


if __name__ == "__main__":
    if len(sys.argv) > 2:
        use_threads(int(sys.argv[2]))
    print(sha256(decide(sys.argv[1])))

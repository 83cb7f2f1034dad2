"""ONNX Runtime, told before it is loaded to send nothing home.

Since 1.31 its builds for Linux note an identifier of the machine in the user's cache and upload
events of their use, unless this variable is set first. No call made later undoes the first note.
Import it from here, and nowhere else.
"""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime as ort

__all__ = ["ort"]

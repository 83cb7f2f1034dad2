"""Small policy files, built node by node: what each test needs, and nothing else."""

import json

import onnx
from onnx import TensorProto, helper

SHAPES = {"ego": [7], "objects": [5, 5], "mask": [5], "risk": [1]}

INPUTS = {
    name: {"units": ["-"], "frame": "B", "shape": ["N", *SHAPES[name]]}
    for name in ("ego", "objects", "mask")
}

METADATA = {
    "twinscrew_format": "1",
    "algorithm": "hand_made",
    "decision_period_s": "0.5",
    "thrust_min_n": "-500",
    "thrust_max_n": "1000.0",
    "thrust_rate_max_n_per_s": "1000",
    "observed_objects": "5",
    "perception_range_m": "20",
    "radius_margin": "1.25",
    "inputs": json.dumps(INPUTS),
    "training_run": "none",
    "commit": "none",
    "created": "2026-01-01T00:00:00+00:00",
}


def float_input(name, shape=None, kind=TensorProto.FLOAT):
    return helper.make_tensor_value_info(name, kind, ["N", *(shape or SHAPES[name])])


def goal_times_ten():
    """thrust_rate = 10 (goal x, goal y)."""
    starts = helper.make_tensor("starts", TensorProto.INT64, [1], [0])
    ends = helper.make_tensor("ends", TensorProto.INT64, [1], [2])
    axes = helper.make_tensor("axes", TensorProto.INT64, [1], [1])
    ten = helper.make_tensor("ten", TensorProto.FLOAT, [1], [10.0])
    nodes = [
        helper.make_node("Slice", ["ego", "starts", "ends", "axes"], ["goal"]),
        helper.make_node("Mul", ["goal", "ten"], ["thrust_rate"]),
    ]
    return nodes, [starts, ends, axes, ten]


def model(nodes=None, initializers=None, *, inputs=None, output=None, metadata=None, opsets=None):
    """A model whose parts can be replaced one at a time."""
    if nodes is None:
        nodes, initializers = goal_times_ten()
    if inputs is None:
        inputs = [float_input(name) for name in ("ego", "objects", "mask")]
    output = output or helper.make_tensor_value_info("thrust_rate", TensorProto.FLOAT, ["N", 2])
    graph = helper.make_graph(nodes, "policy", inputs, [output], initializers or [])
    made = helper.make_model(
        graph, opset_imports=opsets or [helper.make_opsetid("", 18)], ir_version=9
    )
    helper.set_model_props(made, METADATA if metadata is None else metadata)
    return made


def save(folder, **parts):
    path = folder / "policy.onnx"
    onnx.save(model(**parts), path)
    return path

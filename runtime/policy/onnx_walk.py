"""What an ONNX file contains, read from its bytes before anything of it is run.

ONNX Runtime would fetch weights from other files and run any operator that it knows; a policy must
be one file of operators that are known to end and to answer the same again (`ALLOWED`). An ONNX
file is a Protocol Buffers message, so a short walk over its fields finds what is not, without the
onnx package on the boat.

Source: onnx.proto3 (field numbers), Protocol Buffers encoding (wire types).
"""

from __future__ import annotations

from collections.abc import Iterator

from twinscrew.runtime.errors import PolicyError

_CHILDREN: dict[str, dict[int, str]] = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node", 11: "attribute"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {},
}
"""Which fields of which message hold which message."""
_NODE_OPERATOR, _NODE_DOMAIN = 4, 7
_TENSOR_EXTERNAL_DATA, _TENSOR_DATA_LOCATION = 13, 14
_EXTERNAL = 1
_STANDARD_DOMAINS = ("", "ai.onnx")
_ARITHMETIC = """Abs Add Ceil Clip Cos CumSum Div Exp Floor Log Max Mean Min Mod Mul Neg Pow
Reciprocal Round Sign Sin Sqrt Sub Sum Tan Acos Acosh Asin Asinh Atan Atanh Cosh Sinh Erf"""
_LAYERS = """BatchNormalization Celu Conv Elu Einsum GRU Gelu Gemm GroupNormalization HardSigmoid
HardSwish InstanceNormalization LSTM LayerNormalization LeakyRelu LogSoftmax LpNormalization MatMul
MeanVarianceNormalization Mish PRelu RMSNormalization RNN Relu Selu Sigmoid Softmax Softplus
Softsign Swish Tanh ThresholdedRelu AveragePool GlobalAveragePool GlobalMaxPool MaxPool"""
_REDUCTIONS = """ArgMax ArgMin ReduceL1 ReduceL2 ReduceLogSum ReduceLogSumExp ReduceMax ReduceMean
ReduceMin ReduceProd ReduceSum ReduceSumSquare TopK"""
_LOGIC = """And Equal Greater GreaterOrEqual If IsInf IsNaN Less LessOrEqual Not Or Where Xor"""
_SHAPES = """Cast CastLike Compress Concat Constant ConstantOfShape Expand EyeLike Flatten Gather
GatherElements GatherND Identity OneHot Pad Range Reshape ScatterElements ScatterND Shape Size Slice
Split Squeeze Tile Transpose Trilu Unsqueeze NonZero"""
ALLOWED = frozenset(" ".join((_ARITHMETIC, _LAYERS, _REDUCTIONS, _LOGIC, _SHAPES)).split())
"""Standard operators that a policy may have: what networks and their normalisation are made of.
Each ends, and gives the same for the same."""
_WHY_NOT = {
    **dict.fromkeys(("Loop", "Scan", "SequenceMap"), "it may never end"),
    **dict.fromkeys(
        (
            "Bernoulli",
            "Dropout",
            "Multinomial",
            "RandomNormal",
            "RandomNormalLike",
            "RandomUniform",
            "RandomUniformLike",
        ),
        "it draws by chance, and a replay would not give the same decisions",
    ),
}
"""What is wrong with those that somebody may miss."""
_DEEPEST = 32
"""[-] Messages within messages; a policy needs four."""

Value = int | memoryview


def refuse_foreign_parts(data: bytes) -> None:
    """Check that a model stands alone.

    Raises
    ------
    PolicyError
        Not an ONNX file, weights outside the file, or an operator that is not `ALLOWED`, as loops
        and chance are not, wherever in the file they are.
    """
    fields = 0
    for message, number, value in _walk("model", memoryview(data), 0):
        fields += 1
        if message == "tensor" and _is_external(number, value):
            raise PolicyError("weights in another file (external data); allowed: one file")
    if not fields:
        raise PolicyError("empty; expected an ONNX model")


def _is_external(number: int, value: Value) -> bool:
    located = number == _TENSOR_DATA_LOCATION and value == _EXTERNAL
    return located or number == _TENSOR_EXTERNAL_DATA


def _walk(message: str, data: memoryview, depth: int) -> Iterator[tuple[str, int, Value]]:
    """Give (message, field number, value) of everything inside, depth first."""
    if depth > _DEEPEST:
        raise PolicyError("not an ONNX model: nested too deep")
    operator = domain = ""
    for number, value in _fields(data):
        yield message, number, value
        child = _CHILDREN[message].get(number)
        if child is not None and isinstance(value, memoryview):
            yield from _walk(child, value, depth + 1)
        elif message == "node" and isinstance(value, memoryview):
            operator = _text(value) if number == _NODE_OPERATOR else operator
            domain = _text(value) if number == _NODE_DOMAIN else domain
    if message == "node":
        _check_operator(operator, domain)


def _check_operator(operator: str, domain: str) -> None:
    if domain not in _STANDARD_DOMAINS:
        raise PolicyError(
            f"operator {operator!r} of domain {domain!r}; allowed: the standard domain 'ai.onnx'"
        )
    if operator not in ALLOWED:
        why = _WHY_NOT.get(operator, "not one of those that are known to answer the same again")
        raise PolicyError(f"operator {operator!r}: {why}; allowed: {', '.join(sorted(ALLOWED))}")


def _text(value: memoryview) -> str:
    return bytes(value).decode("utf-8", "replace")


def _fields(data: memoryview) -> Iterator[tuple[int, Value]]:
    """Give number and value of each field of one message; groups do not occur in ONNX."""
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        kind = tag & 7
        if kind == 0:
            value, at = _varint(data, at)
            yield tag >> 3, value
            continue
        size, at = _varint(data, at) if kind == 2 else ({1: 8, 5: 4}.get(kind, -1), at)
        if size < 0 or at + size > len(data):
            raise PolicyError("not an ONNX model, or cut short")
        yield tag >> 3, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    """Read a base-128 number of at most 64 bits; give it and where it ends."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            break
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise PolicyError("not an ONNX model, or cut short")

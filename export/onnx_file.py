"""One policy, one file: the actor as a self-contained ONNX graph with its metadata."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import onnx
import torch
from torch import Tensor, nn

from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS
from twinscrew.training.networks import Observations, Pilot
from twinscrew.training.perception import EGO_COLUMNS, OBJECT_COLUMNS

OPSET = 18
FORMAT = "1"
"""[-] Version of the inputs, the output and the metadata that a reader has to know."""

INPUTS = {
    "ego": {
        "shape": ["N", EGO_COLUMNS],
        "frame": "B",
        "columns": ["goal_x", "goal_y", "surge", "sway", "yaw_rate", "thrust_left", "thrust_right"],
        "units": ["m", "m", "m/s", "m/s", "rad/s", "N", "N"],
    },
    "objects": {
        "shape": ["N", OBSERVED_OBJECTS, OBJECT_COLUMNS],
        "frame": "B",
        "columns": ["x", "y", "velocity_x", "velocity_y", "radius"],
        "units": ["m", "m", "m/s", "m/s", "m"],
    },
    "mask": {
        "shape": ["N", OBSERVED_OBJECTS],
        "frame": "-",
        "columns": ["present"],
        "units": ["-"],
    },
}
RISK = {"shape": ["N", 1], "frame": "-", "columns": ["alpha"], "units": ["-"]}
OUTPUT = "thrust_rate"


class DeployedPolicy(nn.Module):
    """The graph that sails: raw observations in, thrust rates out."""

    def __init__(self, pilot: Pilot, rate_max_n_per_s: float) -> None:
        """Take a pilot (observations to actions in [-1, 1]) and the rate [N/s] of action 1."""
        super().__init__()
        self.pilot = pilot
        self.rate_max = rate_max_n_per_s

    @property
    def risk(self) -> float | None:
        """[-] The level that holds where none is given; None: it takes none."""
        return None if self.pilot.risk is None else float(self.pilot.risk)

    def forward(
        self, ego: Tensor, objects: Tensor, mask: Tensor, risk: Tensor | None = None
    ) -> Tensor:
        """Give thrust rates (N, 2) [N/s], left and right, at risk levels (N, 1), if any."""
        action: Tensor = self.pilot(Observations(ego, objects, mask), risk)
        return action * self.rate_max


def example_inputs(count: int, seed: int) -> tuple[Tensor, Tensor, Tensor]:
    """Give random, plausible raw inputs: goals, speeds, thrusts, and 0 to 5 objects in range."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator)

    goal, velocity = uniform(-50, 50, count, 2), uniform(-1, 3.3, count, 2)
    yaw_rate, thrust = uniform(-0.8, 0.8, count, 1), uniform(-500, 1000, count, 2)
    ego = torch.cat([goal, velocity, yaw_rate, thrust], dim=1)
    shape = (count, OBSERVED_OBJECTS)
    position, drift = uniform(-20, 20, *shape, 2), uniform(-3, 3, *shape, 2)
    objects = torch.cat([position, drift, uniform(0.5, 3.0, *shape, 1)], dim=2)
    present = torch.randint(0, OBSERVED_OBJECTS + 1, (count, 1), generator=generator)
    mask = (torch.arange(OBSERVED_OBJECTS) < present).float()
    return ego, objects * mask[:, :, None], mask


def onnx_bytes(policy: DeployedPolicy, metadata: Mapping[str, str]) -> bytes:
    """Trace a policy into ONNX (opset 18, any batch size) and attach its metadata.

    Raises
    ------
    PolicyError
        A metadata value is not a string, or the graph is not valid ONNX.
    """
    for key, value in metadata.items():
        if not isinstance(value, str):
            raise PolicyError(f"metadata {key!r} must be a string, got {value!r}")
    model = _trace(policy.eval())
    _strip(model)
    if policy.risk is not None:
        _give_default(model.graph, "risk", policy.risk)
    onnx.helper.set_model_props(model, dict(metadata))
    try:
        onnx.checker.check_model(model, full_check=True)
    except onnx.checker.ValidationError as error:
        raise PolicyError(f"the exported graph is not valid ONNX: {error}") from error
    return bytes(model.SerializeToString())


def _trace(policy: DeployedPolicy) -> onnx.ModelProto:
    batch = torch.export.Dim("N", min=1)
    # One level for all rows: the graph then broadcasts it, and so takes one a row as well.
    risk = () if policy.risk is None else (torch.full((1, 1), policy.risk),)
    with _quiet_exporter():
        program = torch.onnx.export(
            policy,
            (*example_inputs(2, seed=0), *risk),
            input_names=[*INPUTS, "risk"][: 3 + len(risk)],
            output_names=[OUTPUT],
            opset_version=OPSET,
            dynamic_shapes=(*({0: batch} for _ in INPUTS), *(None for _ in risk)),
            dynamo=True,
            verbose=False,
            external_data=False,
        )
    assert program is not None  # noqa: S101 - None is what other, older modes return
    return program.model_proto


def _give_default(graph: onnx.GraphProto, name: str, value: float) -> None:
    """Give an input, (N, 1), a default: who does not feed it gets `value` in every row.

    In ONNX that is an initializer of the input's name.
    """
    node = next(node for node in graph.input if node.name == name)
    node.type.tensor_type.shape.dim[0].Clear()
    node.type.tensor_type.shape.dim[0].dim_param = "N"
    graph.initializer.append(onnx.helper.make_tensor(name, onnx.TensorProto.FLOAT, [1, 1], [value]))


def _strip(model: onnx.ModelProto) -> None:
    """Drop what tells only how the graph was traced: stack traces and paths of this machine."""
    del model.metadata_props[:]
    del model.graph.metadata_props[:]
    model.doc_string = model.graph.doc_string = ""
    for part in (*model.graph.node, *model.graph.value_info, *model.graph.initializer):
        part.doc_string = ""
        del part.metadata_props[:]
    del model.graph.value_info[:]


@contextmanager
def _quiet_exporter() -> Iterator[None]:
    """Keep the exporter's progress and deprecation notes off the user's screen."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)

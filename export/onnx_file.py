"""One policy, one file: the actor as a self-contained ONNX graph with its metadata."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import onnx
import torch
from torch import Tensor, nn

from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M, SECTORS
from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.hull_units import HULL_COLUMNS, HULL_UNITS
from twinscrew.training.networks import DEFAULT_HULL, Observations, Pilot, circles
from twinscrew.training.perception import (
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    OUTLINE_COLUMNS,
    PAPER,
    Layout,
)

OPSET = 18
FORMAT = "1"
"""[-] Version of the inputs, the output and the metadata that a reader has to know."""


def inputs_of(layout: Layout, risk: float | None, *, any_hull: bool = False) -> dict[str, Any]:
    """Describe a policy's inputs: shape, frame, columns and units of each, and what is left out.

    Parameters
    ----------
    layout
        What it is shown.
    risk
        [-] The level that holds where none is given; None: it takes none.
    any_hull
        Units are the hull's own: lengths are divided by its unit of length, and so on.
    """
    k = layout.objects
    inputs: dict[str, Any] = {
        "ego": {
            "shape": ["N", EGO_COLUMNS],
            "frame": "B",
            "columns": [
                *("goal_x", "goal_y", "surge", "sway", "yaw_rate", "thrust_left", "thrust_right")
            ],
            "units": ["m", "m", "m/s", "m/s", "rad/s", "N", "N"],
        },
        "objects": {
            "shape": ["N", k, OBJECT_COLUMNS],
            "frame": "B",
            "columns": ["x", "y", "velocity_x", "velocity_y", "radius"],
            "units": ["m", "m", "m/s", "m/s", "m"],
        },
        "mask": {"shape": ["N", k], "frame": "-", "columns": ["present"], "units": ["-"]},
    }
    if layout.extended:
        inputs["outlines"] = {
            "shape": ["N", k, OUTLINE_COLUMNS],
            "frame": "B",
            "columns": ["half_length", "half_beam", "heading"],
            "units": ["m", "m", "rad"],
            "default": "0: every object is a circle",
        }
        inputs["hull"] = {
            "shape": ["N", len(HULL_COLUMNS)],
            "frame": "-",
            "columns": list(HULL_COLUMNS),
            "units": list(HULL_UNITS),
            "default": [round(value, 6) for value in DEFAULT_HULL],
        }
    if layout.contour:
        inputs["contour"] = {
            "shape": ["N", SECTORS],
            "frame": "B",
            "columns": ["distance"],
            "units": ["m"],
            "range_m": CONTOUR_RANGE_M,
            "default": f"{CONTOUR_RANGE_M:g}: nothing fixed",
        }
    if risk is not None:
        inputs["risk"] = {
            "shape": ["N", 1],
            "frame": "-",
            "columns": ["alpha"],
            "units": ["-"],
            "default": risk,
        }
    if any_hull:
        for one in inputs.values():
            one["scale"] = SCALE
    return inputs


SCALE = (
    "in the hull's own units: divide lengths by l, times by t, forces by f, and what is made of "
    "them accordingly (speeds by l / t); multiply the answer by f / t and the period by t; "
    "t = max((length / 5 m) / (top speed / 3.3 m/s), 0.4), l = t top speed / 3.3 m/s, "
    "f = greatest thrust / 1000 N: all 1 for the default vessel"
)
"""How a policy for any hull is fed; `runtime.policy.hull_units.units_of` is the same."""
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
        self,
        ego: Tensor,
        objects: Tensor,
        mask: Tensor,
        outlines: Tensor | None = None,
        hull: Tensor | None = None,
        contour: Tensor | None = None,
        beyond: Tensor | None = None,  # noqa: ARG002 - an observation's last part, for critics
        risk: Tensor | None = None,
    ) -> Tensor:
        """Give thrust rates (N, 2) [N/s], left and right, at risk levels (N, 1), if any."""
        seen = circles(ego, objects, mask)
        if outlines is not None and hull is not None:
            hull = hull.expand(ego.shape[0], -1)
            seen = seen._replace(outlines=outlines, hull=hull)
        if contour is not None:
            seen = seen._replace(contour=contour.expand(ego.shape[0], -1))
        action: Tensor = self.pilot(seen, risk)
        return action * self.rate_max


def example_inputs(count: int, seed: int, layout: Layout = PAPER) -> Observations:
    """Give random, plausible inputs: goals, speeds, thrusts, and up to K objects in range."""
    generator = torch.Generator().manual_seed(seed)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator)

    goal, velocity = uniform(-50, 50, count, 2), uniform(-1, 3.3, count, 2)
    yaw_rate, thrust = uniform(-0.8, 0.8, count, 1), uniform(-500, 1000, count, 2)
    ego = torch.cat([goal, velocity, yaw_rate, thrust], dim=1)
    shape = (count, layout.objects)
    position, drift = uniform(-20, 20, *shape, 2), uniform(-3, 3, *shape, 2)
    objects = torch.cat([position, drift, uniform(0.5, 3.0, *shape, 1)], dim=2)
    present = torch.randint(0, layout.objects + 1, (count, 1), generator=generator)
    mask = (torch.arange(layout.objects) < present).float()
    seen = circles(ego, objects * mask[:, :, None], mask)
    if not layout.extended:
        return seen
    half, heading = uniform(0.5, 10, *shape, 2), uniform(-3, 3, *shape, 1)
    outlined = uniform(0, 1, *shape, 1) < 0.5
    outlines = torch.cat([half, heading], dim=2) * mask[:, :, None] * outlined
    hull = seen.hull * uniform(0.7, 1.4, count, seen.hull.shape[1])
    if not layout.contour:
        return seen._replace(outlines=outlines, hull=hull)
    contour = uniform(0.0, 2.0 * CONTOUR_RANGE_M, count, SECTORS).clamp(max=CONTOUR_RANGE_M)
    return seen._replace(outlines=outlines, hull=hull, contour=contour)


def onnx_bytes(
    policy: DeployedPolicy, metadata: Mapping[str, str], layout: Layout = PAPER
) -> bytes:
    """Trace a policy into ONNX (opset 18, any batch size) and attach its metadata.

    Raises
    ------
    PolicyError
        A metadata value is not a string, or the graph is not valid ONNX.
    """
    for key, value in metadata.items():
        if not isinstance(value, str):
            raise PolicyError(f"metadata {key!r} must be a string, got {value!r}")
    model = _trace(policy.eval(), layout)
    _strip(model)
    if layout.extended:
        _give_default(model.graph, "outlines", [1, 1, OUTLINE_COLUMNS], [0.0] * OUTLINE_COLUMNS)
        _give_default(model.graph, "hull", [1, len(DEFAULT_HULL)], DEFAULT_HULL)
    if layout.contour:
        _give_default(model.graph, "contour", [1, SECTORS], [CONTOUR_RANGE_M] * SECTORS)
    if policy.risk is not None:
        _give_default(model.graph, "risk", [1, 1], [policy.risk])
    onnx.helper.set_model_props(model, dict(metadata))
    try:
        onnx.checker.check_model(model, full_check=True)
    except onnx.checker.ValidationError as error:
        raise PolicyError(f"the exported graph is not valid ONNX: {error}") from error
    return bytes(model.SerializeToString())


def _trace(policy: DeployedPolicy, layout: Layout) -> onnx.ModelProto:
    batch, count = torch.export.Dim("N", min=1), torch.export.Dim("K", min=1)
    example = example_inputs(2, 0, layout)
    fed: dict[str, tuple[Tensor, dict[int, Any] | None]] = {
        name: (getattr(example, name), {0: batch}) for name in ("ego", "objects", "mask")
    }
    if layout.extended:  # a set of objects: any number will do
        for name in ("objects", "mask", "outlines"):
            fed[name] = (getattr(example, name), {0: batch, 1: count})
        # What is traced as one row for all is broadcast by the graph, which so takes one a row too.
        fed["hull"] = (example.hull[:1], None)
    if layout.contour:
        fed["contour"] = (example.contour[:1], None)
    if policy.risk is not None:
        fed["risk"] = (torch.full((1, 1), policy.risk), None)
    shapes = {name: shape for name, (_, shape) in fed.items()}
    with _quiet_exporter():
        program = torch.onnx.export(
            policy,
            kwargs={name: tensor for name, (tensor, _) in fed.items()},
            input_names=list(fed),
            output_names=[OUTPUT],
            opset_version=OPSET,
            dynamic_shapes=shapes,
            dynamo=True,
            verbose=False,
            external_data=False,
        )
    assert program is not None  # noqa: S101 - None is what other, older modes return
    return program.model_proto


def _give_default(
    graph: onnx.GraphProto, name: str, shape: Sequence[int], values: Sequence[float]
) -> None:
    """Give an input, (N, ...), a default: who does not feed it gets `values` in every row.

    In ONNX that is an initializer of the input's name.
    """
    node = next(node for node in graph.input if node.name == name)
    node.type.tensor_type.shape.dim[0].Clear()
    node.type.tensor_type.shape.dim[0].dim_param = "N"
    made = onnx.helper.make_tensor(name, onnx.TensorProto.FLOAT, list(shape), list(values))
    graph.initializer.append(made)


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

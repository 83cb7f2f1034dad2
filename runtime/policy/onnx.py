"""A trained policy: one ONNX file, checked from end to end before a propeller can turn."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M
from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.files import read_file
from twinscrew.runtime.messages.types import Float32, Float64, Observation
from twinscrew.runtime.policy.metadata import (
    CONTOUR_INPUT,
    EXTENDED_INPUTS,
    OPTIONAL_INPUTS,
    OUTPUT_NAME,
    OUTPUT_SHAPE,
    PolicyExpectation,
    PolicyMetadata,
    check_expectation,
    input_shapes,
    read_metadata,
)
from twinscrew.runtime.policy.observation import Shown, require_finite
from twinscrew.runtime.policy.onnx_runtime import ort
from twinscrew.runtime.policy.onnx_walk import refuse_foreign_parts
from twinscrew.runtime.policy.risk import RiskSettings, adaptive_level

FLOAT32 = "tensor(float)"
AS_SHIPPED = RiskSettings()


class OnnxPolicy:
    """A policy from a file: raw observations in SI units in, thrust rates [N/s] out."""

    def __init__(
        self,
        path: Path | str,
        expect: PolicyExpectation | None = None,
        risk: RiskSettings = AS_SHIPPED,
    ) -> None:
        """Load and check a policy file.

        Parameters
        ----------
        path
            The file.
        expect
            What the vessel needs it to have been made for.
        risk
            How cautious a policy that takes a risk level is to be.

        Raises
        ------
        PolicyError
            Names the file, what is wrong with it and what is allowed.
        """
        self.path = Path(path)
        try:
            data = _read(self.path)
            refuse_foreign_parts(data)
            self._session = _session(data)
            self.metadata = read_metadata(self._session.get_modelmeta().custom_metadata_map)
            shapes = input_shapes(self.metadata.observed_objects)
            _check_graph(self._session, shapes)
            _check_described(self._session, self.metadata)
            check_expectation(self.metadata, expect or PolicyExpectation())
            self._risk = risk
            self._feed = _feed(self._session, risk, shapes)
            self._answer(where="at rest, nothing in sight")
        except (PolicyError, UnicodeDecodeError) as error:  # names and metadata may be no text
            raise PolicyError(f"{self.path}: {error}") from error
        self._inputs = {node.name for node in graph_inputs(self._session)}
        self.sha256 = hashlib.sha256(data).hexdigest()
        """The file's SHA-256, for logs and replays."""

    @property
    def name(self) -> str:
        """The algorithm that trained it."""
        return self.metadata.algorithm

    @property
    def period_s(self) -> float:
        """[s] Time between two decisions."""
        return self.metadata.decision_period_s

    @property
    def shown(self) -> Shown:
        """What it takes."""
        m = self.metadata
        contour_m = CONTOUR_RANGE_M if m.contour else None
        return Shown(m.observed_objects, m.extended, m.perception_range_m, contour_m)

    def act(self, observation: Observation) -> Float64:
        """Give the thrust rates, (2,) [N/s], clipped to what the policy was trained with.

        Raises
        ------
        PolicyError
            The observation is not finite, or the graph failed or answered with anything but two
            finite numbers.
        """
        require_finite(observation)  # a ReLU would turn NaN into 0
        self._feed["ego"][0] = observation.ego
        self._feed["objects"][0] = observation.objects
        self._feed["mask"][0] = observation.mask
        # A file's own defaults are circles, seen by the default hull, and nothing that is fixed.
        for name in (*EXTENDED_INPUTS, CONTOUR_INPUT):
            told = getattr(observation, name)
            if name in self._inputs and told is not None:
                self._feed[name] = told[None]
        if self._risk.level == "adaptive":
            self._feed["risk"][0] = adaptive_level(
                observation.objects, observation.mask, self._risk
            )
        limit = self.metadata.thrust_rate_max_n_per_s
        return np.clip(self._answer(), -limit, limit)

    def reset(self) -> None:
        """Do nothing: a policy file remembers nothing."""

    def _answer(self, where: str = "") -> Float64:
        try:
            (answer,) = self._session.run([OUTPUT_NAME], self._feed)
        except Exception as error:  # ONNX Runtime has no base class of its own
            raise PolicyError(f"the graph failed: {error}") from error
        when = f" ({where})" if where else ""
        if answer.shape != (1, *OUTPUT_SHAPE):
            raise PolicyError(f"answered with shape {answer.shape}, expected (1, 2){when}")
        if not np.isfinite(answer).all():
            raise PolicyError(f"answered with {answer[0].tolist()}: not finite{when}")
        rate: Float64 = answer[0].astype(np.float64)
        return rate


def _read(path: Path) -> bytes:
    try:
        return read_file(path)
    except OSError as error:
        raise PolicyError(f"cannot be read: {error.strerror or error}") from error


def _session(data: bytes) -> Any:
    """Open a session that keeps to the calling thread: a spinning pool showed 24 ms maxima."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4  # fatal only: what goes wrong is raised
    try:
        return ort.InferenceSession(
            data,
            options,
            providers=["CPUExecutionProvider"],
            enable_fallback=0,  # else it tries again the same way, and prints that it does
        )
    except Exception as error:  # ONNX Runtime has no base class of its own
        raise PolicyError(f"not a model that ONNX Runtime can run: {error}") from error


def _check_graph(session: Any, shapes: dict[str, tuple[int, ...]]) -> None:
    """Check names, types and shapes of the graph's inputs and output."""
    found = {node.name: node for node in graph_inputs(session)}
    for name in found:
        if name not in shapes:
            raise PolicyError(f"input {name!r}; allowed: {', '.join(shapes)}")
    for name, shape in shapes.items():
        if name in found:
            _check_tensor("input", found[name], shape)
        elif name not in OPTIONAL_INPUTS:
            raise PolicyError(f"input {name!r} is missing")
    outputs = session.get_outputs()
    if [node.name for node in outputs] != [OUTPUT_NAME]:
        names = ", ".join(node.name for node in outputs)
        raise PolicyError(f"outputs are {names}; allowed: {OUTPUT_NAME} alone")
    _check_tensor("output", outputs[0], OUTPUT_SHAPE)


def _check_described(session: Any, metadata: PolicyMetadata) -> None:
    """Refuse metadata that tells of a contour otherwise than the graph: it would see no edges.

    Whoever is shown the contour is not shown the standing objects that are a part of it.
    """
    takes = any(node.name == CONTOUR_INPUT for node in graph_inputs(session))
    if takes != metadata.contour:
        has, lacks = ("graph", "metadata") if takes else ("metadata", "graph")
        raise PolicyError(f"input {CONTOUR_INPUT!r} is in its {has}, and not in its {lacks}")


def _check_tensor(kind: str, node: Any, shape: tuple[int, ...]) -> None:
    if node.type != FLOAT32:
        raise PolicyError(f"{kind} {node.name!r} is {node.type}; allowed: {FLOAT32}")
    batch, *rest = node.shape or [0]
    fits = len(rest) == len(shape) and all(
        dim == size or isinstance(dim, str) for dim, size in zip(rest, shape, strict=True)
    )
    if not fits or (isinstance(batch, int) and batch != 1):
        raise PolicyError(f"{kind} {node.name!r} has shape {node.shape}; allowed: {['N', *shape]}")


def graph_inputs(session: Any) -> list[Any]:
    """Give a graph's inputs; those that have a default and may be left out come last."""
    return [*session.get_inputs(), *session.get_overridable_initializers()]


def risk_feed(session: Any, rows: int, risk: RiskSettings) -> dict[str, Float32]:
    """Give what is fed of the risk levels, (rows, 1): nothing where the file's own is to hold.

    Raises
    ------
    PolicyError
        A level is set, and the policy was not trained for any.
    """
    if not any(node.name == "risk" for node in graph_inputs(session)):
        if risk.level != "shipped":
            raise PolicyError(f"takes no risk level; allowed: 'shipped', got {risk.level!r}")
        return {}
    if risk.level == "shipped" and all(node.name != "risk" for node in session.get_inputs()):
        return {}
    level = risk.level if isinstance(risk.level, float) else 1.0
    return {"risk": np.full((rows, 1), level, dtype=np.float32)}


def _feed(
    session: Any, risk: RiskSettings, shapes: dict[str, tuple[int, ...]]
) -> dict[str, Float32]:
    """Make the arrays that every decision is written into."""
    needed = [name for name in shapes if name not in OPTIONAL_INPUTS]
    feed = {name: np.zeros((1, *shapes[name]), dtype=np.float32) for name in needed}
    return feed | risk_feed(session, 1, risk)

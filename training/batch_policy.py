"""Policies for many vessels at once: what `evaluate` asks for thrust rates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.errors import ConfigError, PolicyError
from twinscrew.runtime.messages.types import Float64, Observation
from twinscrew.runtime.policy.load import Policy, load_policy
from twinscrew.runtime.policy.metadata import OUTPUT_NAME, OUTPUT_SHAPE
from twinscrew.runtime.policy.onnx import AS_SHIPPED, OnnxPolicy, risk_feed
from twinscrew.runtime.policy.onnx_runtime import ort
from twinscrew.runtime.policy.risk import RiskSettings, adaptive_level
from twinscrew.runtime.settings import shipped
from twinscrew.training.perception import Observations

Mask = NDArray[np.bool_]
BASELINES = ("apf", "mpc")


class BatchPolicy(Protocol):
    """A policy that decides for all vessels of all episodes in one call."""

    @property
    def name(self) -> str:
        """What the policy calls itself."""

    @property
    def period_s(self) -> float:
        """[s] Between two decisions."""

    def begin(self, episodes: int, vessels: int) -> None:
        """Forget everything: new episodes follow."""

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]; those of vessels not `active`, (E, V), are 0."""


def open_policy(spec: str, risk: RiskSettings = AS_SHIPPED) -> BatchPolicy:
    """Give a policy by what the user typed: an ONNX file, a shipped policy's name, apf or mpc."""
    if spec in BASELINES:
        return OneByOne(lambda: load_policy(spec, risk=risk))
    try:
        return OnnxBatch(shipped("policies", spec, ".onnx"), risk)
    except ConfigError as error:
        raise PolicyError(f"{error}; or {', '.join(BASELINES)}, or an ONNX file") from error


class OnnxBatch:
    """A policy file, after all the checks of `OnnxPolicy`, asked with as many rows as there are."""

    def __init__(self, path: Path, risk: RiskSettings = AS_SHIPPED) -> None:
        self.metadata = OnnxPolicy(path, risk=risk).metadata
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # fatal only: what goes wrong is raised
        self._session: Any = ort.InferenceSession(
            path.read_bytes(), options, providers=["CPUExecutionProvider"]
        )
        self._risk = risk

    @property
    def name(self) -> str:
        """The algorithm that trained it."""
        return self.metadata.algorithm

    @property
    def period_s(self) -> float:
        """[s] Between two decisions."""
        return self.metadata.decision_period_s

    def begin(self, episodes: int, vessels: int) -> None:
        """Do nothing: a policy file remembers nothing."""

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]."""
        feed = {"ego": seen.ego[active], "objects": seen.objects[active], "mask": seen.mask[active]}
        feed |= risk_feed(self._session, len(feed["ego"]), self._risk)
        if self._risk.level == "adaptive":
            feed["risk"] = adaptive_level(feed["objects"], feed["mask"], self._risk)
        rows = len(feed["ego"])
        try:
            answer = self._session.run([OUTPUT_NAME], feed)[0]
        except Exception as error:  # ONNX Runtime has no base class of its own
            raise PolicyError(f"{self.name} failed with {rows} rows at once: {error}") from error
        if answer.shape != (rows, *OUTPUT_SHAPE):
            raise PolicyError(f"{self.name} answered {rows} rows with shape {answer.shape}")
        if not np.isfinite(answer).all():
            raise PolicyError(f"{self.name} answered with numbers that are not finite")
        limit = self.metadata.thrust_rate_max_n_per_s
        rates = np.zeros((*active.shape, 2))
        rates[active] = np.clip(answer, -limit, limit)
        return rates


class OneByOne:
    """A policy that decides for one vessel at a time; each vessel has its own."""

    def __init__(self, make: Callable[[], Policy]) -> None:
        self._make = make
        self._example = make()
        self._policies: list[list[Policy]] = []

    @property
    def name(self) -> str:
        """What the policy calls itself."""
        return self._example.name

    @property
    def period_s(self) -> float:
        """[s] Between two decisions."""
        return self._example.period_s

    def begin(self, episodes: int, vessels: int) -> None:
        """Give every vessel a fresh policy."""
        self._policies = [[self._make() for _ in range(vessels)] for _ in range(episodes)]

    def rates(self, seen: Observations, active: Mask) -> Float64:
        """Give thrust rates, (E, V, 2) [N/s]."""
        rates = np.zeros((*active.shape, 2))
        for episode, vessel in np.argwhere(active):
            one = Observation(
                ego=seen.ego[episode, vessel],
                objects=seen.objects[episode, vessel],
                mask=seen.mask[episode, vessel],
            )
            rates[episode, vessel] = self._policies[episode][vessel].act(one)
        return rates

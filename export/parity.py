"""Whether the file says what the network says, and how fast it is."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from twinscrew.export.onnx_file import OUTPUT, DeployedPolicy, example_inputs
from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.policy.onnx import graph_inputs
from twinscrew.runtime.policy.onnx_runtime import ort
from twinscrew.training.environment import EnvironmentSettings, VectorEnv
from twinscrew.training.networks import Observations, circles, unpack
from twinscrew.training.perception import PAPER, Layout
from twinscrew.training.scenarios import ScenarioSettings

TOLERANCE_N_PER_S = 0.05
"""[N/s] Of a range of +-1000: float32 sums in another order differ by less."""


class Parity(NamedTuple):
    """What the comparison gave."""

    observations: int
    """[-] How many were compared."""
    max_difference_n_per_s: float
    """[N/s] Greatest difference of a thrust rate, in batches and one by one."""
    decision_ms: float
    """[ms] Median time of one decision, one thread."""


class OnnxFile:
    """An exported policy, asked in batches."""

    def __init__(self, file: Path) -> None:
        options = ort.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4  # fatal only: what goes wrong is raised
        self._session = ort.InferenceSession(str(file), options, ["CPUExecutionProvider"])
        self._inputs = {node.name for node in graph_inputs(self._session)}

    def rates(self, observations: Observations, risk: Tensor | None = None) -> Tensor:
        """Give thrust rates, (N, 2) [N/s], at the file's own risk level or at these, (N, 1)."""
        named = observations._asdict().items()
        feed = {name: part for name, part in named if name in self._inputs}
        return self.asked(feed if risk is None else {**feed, "risk": risk})

    def asked(self, feed: Mapping[str, Tensor]) -> Tensor:
        """Give thrust rates, (N, 2) [N/s], for just these inputs."""
        arrays = {name: part.numpy() for name, part in feed.items()}
        return torch.from_numpy(self._session.run([OUTPUT], arrays)[0])


def check_parity(policy: DeployedPolicy, file: Path, layout: Layout = PAPER) -> Parity:
    """Compare a file with the network it was made from.

    On random observations and on some recorded in crowded episodes, in batches and one by one; a
    policy that takes a risk level with its own and with a different one in every row; one that
    takes outlines and a hull also without them.

    Raises
    ------
    PolicyError
        They differ by more than `TOLERANCE_N_PER_S`.
    """
    session = OnnxFile(file)
    batches = [example_inputs(1000, 1, layout), recorded_observations(layout)]
    single = [Observations(*(part[k : k + 1] for part in batches[1])) for k in range(100)]
    with torch.no_grad():
        worst = max(
            float((session.rates(batch, risk) - policy(*batch, risk=risk)).abs().max())
            for batch in [*batches, *single]
            for risk in _levels(policy, len(batch.ego))
        )
        if layout.extended:
            plain = circles(*batches[0][:3])
            fed = {"ego": plain.ego, "objects": plain.objects, "mask": plain.mask}
            worst = max(worst, float((session.asked(fed) - policy(*plain)).abs().max()))
    if not worst <= TOLERANCE_N_PER_S:
        raise PolicyError(
            f"{file}: differs from the network by {worst:.3g} N/s; "
            f"allowed: up to {TOLERANCE_N_PER_S} N/s"
        )
    count = sum(len(batch.ego) for batch in batches)
    return Parity(count, worst, _decision_ms(session, single))


def _levels(policy: DeployedPolicy, rows: int) -> list[Tensor | None]:
    """Give the risk levels, (rows, 1), to compare at; none: the policy's own, if it has one."""
    return [None] if policy.risk is None else [None, torch.linspace(1.0, 0.1, rows)[:, None]]


def recorded_observations(
    layout: Layout = PAPER, decisions: int = 40, seed: int = 11
) -> Observations:
    """Give what vessels see while they sail at random in the most crowded setting.

    And in harbours, if edges are seen.
    """
    rows = [ScenarioSettings(robots=5, buoys=4, min_distance_m=40.0)]
    if layout.contour:
        rows.append(ScenarioSettings(robots=5, harbour=("mixed", "gap")))
    settings = EnvironmentSettings(
        scenarios=tuple(rows),
        observed_objects=layout.objects,
        extended=layout.extended,
        contour=layout.contour,
    )
    environment = VectorEnv(settings, 8, seed)
    generator = np.random.default_rng(seed)
    seen, recorded = environment.reset(), []
    for _ in range(decisions):
        recorded.append(seen.rows.reshape(-1, seen.rows.shape[-1]))
        seen = environment.step(generator.uniform(-0.5, 1.0, (8, 5, 2))).observation
    return Observations(
        *(part.contiguous() for part in unpack(torch.from_numpy(np.concatenate(recorded))))
    )


def _decision_ms(session: OnnxFile, observations: list[Observations]) -> float:
    """Time decisions one by one, several times over, and give the median in milliseconds."""
    times = []
    for _ in range(10):
        for observation in observations:
            start = time.perf_counter()
            session.rates(observation)
            times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1e3

"""The training loop: gather, learn, log, evaluate, checkpoint; the same for every agent."""

from __future__ import annotations

import json
import platform
import time
from pathlib import Path
from typing import Any

import msgspec
import torch

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.settings import convert
from twinscrew.training import runs
from twinscrew.training.agents.base import Metrics
from twinscrew.training.agents.registry import algorithm, make_agent
from twinscrew.training.buffer import Batch, ReplayBuffer, to_device
from twinscrew.training.collect import Collector
from twinscrew.training.logs import Logs, Progress
from twinscrew.training.priority import PrioritisedReplay
from twinscrew.training.train_settings import Phase, TrainSettings, phase_settings
from twinscrew.training.validate import NetworkPolicy, Score, validate


class Training:
    """One seed's run in its directory."""

    def __init__(self, settings: TrainSettings, seed: int, folder: Path, device: str) -> None:
        self.settings, self.seed, self.folder, self.device = settings, seed, folder, device
        self.agent = make_agent(settings.agent, seed, device)
        self.replay = make_replay(settings)
        self.generator = torch.Generator().manual_seed(seed)
        self.phase = 0
        self.phase_step = 0
        self.step = 0
        self.updates = 0.0
        self.transitions = 0
        self.seconds = 0.0
        self.best: float | None = None

    def run(self, progress: Progress) -> None:
        """Train to the end of the last phase, from the run directory's checkpoint if it has one."""
        told = {"seed": self.seed, "settings": msgspec.to_builtins(self.settings)}
        runs.claim(self.folder, told, algorithm(self.settings.agent), complete)
        resumed = (self.folder / runs.CHECKPOINT).exists()
        if resumed:
            self._restore()
        with Logs(self.folder) as logs:
            if not resumed:
                logs.write("start", seed=self.seed, machine=machine(), device=self.device)
            for number in range(self.phase, len(self.settings.phases)):
                if number > self.phase:
                    self.phase, self.phase_step = number, 0
                self._run_phase(self.settings.phases[number], logs, progress)
            logs.write("end", step=self.step, seconds=round(self.seconds, 1))

    def _run_phase(self, phase: Phase, logs: Logs, progress: Progress) -> None:
        s = self.settings
        told = phase_settings(s, phase)
        self.agent.retune(told.agent)
        if not phase.keep_replay:
            self.replay.clear()
        collector = Collector(s, told, self.seed, self.step)
        started = time.monotonic() - self.seconds
        metrics: Metrics = {}
        while self.phase_step < phase.steps:
            self._gather(collector)
            metrics = self._learn(self.phase_step / phase.steps) or metrics
            self.seconds = time.monotonic() - started
            progress.advance(self.step)
            if metrics and self.step % s.log_every == 0:
                logs.write("train", **self._where(), **_numbers(metrics))
            if self.step % s.evaluate_every == 0 or self.phase_step == phase.steps:
                self._evaluate(logs, progress)
                self.seconds = time.monotonic() - started

    def _gather(self, collector: Collector) -> None:
        random = self.transitions < self.settings.warm_up
        rows = collector.step(self.agent, self.step, random=random)
        self.replay.add(torch.from_numpy(rows))
        self.transitions += len(rows)
        self.step += 1
        self.phase_step += 1

    def _learn(self, progress: float) -> Metrics:
        metrics: Metrics = {}
        if len(self.replay) < self.settings.warm_up:
            return metrics
        self.updates += self.settings.updates_per_step
        while self.updates >= 1.0:
            batch = self.replay.sample(self.settings.batch, self.generator)
            metrics = self.agent.update(to_device(batch, self.agent.device), progress)
            self._reprioritise(batch, metrics)
            self.updates -= 1.0
        return metrics

    def _reprioritise(self, batch: Batch, metrics: Metrics) -> None:
        """Hand the losses of a batch back to a replay that draws by them."""
        losses = metrics.pop("priority", None)
        if isinstance(self.replay, PrioritisedReplay) and batch.places is not None:
            if losses is None:
                raise ConfigError(
                    "this agent gives no priorities; leave the table out", key="priority"
                )
            self.replay.reprioritise(batch.places, losses)
            self.replay.advance(self.step / sum(phase.steps for phase in self.settings.phases))

    def _evaluate(self, logs: Logs, progress: Progress) -> None:
        s = self.settings
        policy = NetworkPolicy(self.agent.deployed(s.radius_margin), s.environment.period_s)
        rough = phase_settings(s, s.phases[self.phase]).rough if s.rough_share > 0.0 else None
        score = validate(policy, s.evaluation_episodes, s.validation_seed, rough)
        logs.write("evaluation", **self._where(), **score.record())
        progress.report(self.step, score)
        if self.best is None or score.value > self.best:
            self.best = score.value
            self._save(runs.BEST, score)
        self._save(runs.CHECKPOINT, score)

    def _where(self) -> dict[str, Any]:
        name = self.settings.phases[self.phase].name
        return {
            "phase": name,
            "step": self.step,
            "transitions": self.transitions,
            "updates": self.agent.updates,
            "seconds": round(self.seconds, 1),
        }

    def _save(self, name: str, score: Score) -> None:
        content = {
            "agent": self.agent.state(),
            "generator": self.generator.get_state(),
            "seed": self.seed,
            "phase": self.phase,
            "phase_step": self.phase_step,
            "best": self.best,
            "score": json.dumps(score.record()),
            "where": self._where(),
            "fraction": self.updates,
        }
        runs.save_checkpoint(self.folder / name, algorithm(self.settings.agent), content)

    def _restore(self) -> None:
        file = self.folder / runs.CHECKPOINT
        content = runs.load_checkpoint(file, algorithm(self.settings.agent))
        try:
            self.agent.restore(content["agent"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise ConfigError("checkpoint of other networks", file=file) from error
        self.generator.set_state(content["generator"])
        self.phase, self.phase_step = content["phase"], content["phase_step"]
        self.best, self.updates = content["best"], content["fraction"]
        where = content["where"]
        self.step, self.transitions = where["step"], where["transitions"]
        self.seconds = where["seconds"]


def complete(settings: dict[str, Any]) -> dict[str, Any]:
    """Fill in the defaults of settings as plain values; what cannot be read stays as it is."""
    try:
        known = convert(settings, TrainSettings)
    except ConfigError:
        return settings
    plain: dict[str, Any] = json.loads(json.dumps(msgspec.to_builtins(known)))
    return plain


def make_replay(settings: TrainSettings) -> ReplayBuffer:
    """Build the replay that the settings name."""
    if settings.priority is not None:
        return PrioritisedReplay(settings.replay, settings.priority)
    return ReplayBuffer(settings.replay)


def machine() -> str:
    """Say what the run is made on."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    processor = names[0] if names else platform.machine()
    return f"{processor}, {torch.get_num_threads()} thread(s), torch {torch.__version__}"


def _numbers(metrics: Metrics) -> dict[str, float]:
    return {name: round(float(value), 5) for name, value in metrics.items()}

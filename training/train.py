"""One seed's run: what it holds, how it is logged, evaluated, saved and taken up again."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import torch

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float32
from twinscrew.runtime.settings import convert
from twinscrew.training import runs
from twinscrew.training.agents.lesson import Metrics
from twinscrew.training.agents.registry import algorithm, make_agent
from twinscrew.training.buffer import Drawn, ReplayBuffer
from twinscrew.training.logs import Logs
from twinscrew.training.priority import PrioritisedReplay
from twinscrew.training.replay_files import ReplayFiles
from twinscrew.training.train_settings import PhaseSettings, TrainSettings, phase_settings
from twinscrew.training.validate import NetworkPolicy, Score, validate


class Training:
    """One seed's run in its directory: its agent, its replay, and how far it is."""

    def __init__(self, settings: TrainSettings, seed: int, folder: Path, device: str) -> None:
        self.settings, self.seed, self.folder, self.device = settings, seed, folder, device
        self.agent = make_agent(settings.agent, seed, device)
        self.replay = make_replay(settings)
        self._files = ReplayFiles(folder, self.replay)
        self.generator = torch.Generator().manual_seed(seed)
        self.phase = 0
        self.phase_step = 0
        self.step = 0
        self.due = 0.0
        self.transitions = 0
        self.seconds = 0.0
        self.best: float | None = None

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Claim the directory, go on from its checkpoint if it has one, and log."""
        told = {"seed": self.seed, "settings": msgspec.to_builtins(self.settings)}
        runs.claim(self.folder, told, algorithm(self.settings.agent), complete)
        resumed = (self.folder / runs.CHECKPOINT).exists()
        if resumed:
            self._restore()
            runs.trim_log(self.folder / runs.LOG, self.step)
        with Logs(self.folder, self.step) as self._logs:
            if not resumed:
                self._logs.write("start", seed=self.seed, machine=machine(), device=self.device)
            yield
            self._logs.write("end", step=self.step, seconds=round(self.seconds, 1))

    def enter(self, number: int) -> PhaseSettings:
        """Begin a phase, or go on in it."""
        phase = self.settings.phases[number]
        if number > self.phase:
            self.phase, self.phase_step = number, 0
            if not phase.keep_replay:
                self.replay.clear()
        told = phase_settings(self.settings, phase)
        self.agent.retune(told.agent)
        return told

    def take(self, rows: Float32) -> None:
        """Keep the transitions, (n, 78), of one more environment step."""
        self.replay.add(torch.from_numpy(rows))
        self.transitions += len(rows)
        self.step += 1
        self.phase_step += 1

    def draw(self) -> Drawn:
        """Draw what an update learns from."""
        return self.replay.sample(self.settings.batch, self.generator)

    def reprioritise(self, drawn: Drawn, metrics: Metrics) -> None:
        """Hand the losses of a batch back to a replay that draws by them."""
        losses = metrics.pop("priority", None)
        if isinstance(self.replay, PrioritisedReplay) and drawn.places is not None:
            if losses is None:
                raise ConfigError(
                    "this agent gives no priorities; leave the table out", key="priority"
                )
            self.replay.reprioritise(drawn.places, losses)
            self.replay.advance(self.step / sum(phase.steps for phase in self.settings.phases))

    def tell(self, metrics: Metrics) -> None:
        """Log what an update told."""
        numbers = {name: round(float(value), 5) for name, value in metrics.items()}
        self._logs.write("train", **self._where(), **numbers)

    def evaluate(self) -> Score:
        """Evaluate, log, and write the checkpoints."""
        s = self.settings
        policy = NetworkPolicy(self.agent.deployed(s.radius_margin), s.environment.period_s)
        rough = phase_settings(s, s.phases[self.phase]).rough if s.rough_share > 0.0 else None
        score = validate(policy, s.evaluation_episodes, s.validation_seed, rough)
        self._logs.write("evaluation", **self._where(), **score.record())
        if self.best is None or score.value > self.best:
            self.best = score.value
            self._save(runs.BEST, score)
        kept = self._files.save() if s.save_replay and not self.is_finished else None
        self._save(runs.CHECKPOINT, score, kept)
        if kept is None:
            self._files.drop()
        self._files.tidy()
        return score

    @property
    def is_finished(self) -> bool:
        """Whether the last phase is at its end."""
        last = len(self.settings.phases) - 1
        return self.phase == last and self.phase_step >= self.settings.phases[last].steps

    def _where(self) -> dict[str, Any]:
        name = self.settings.phases[self.phase].name
        return {
            "phase": name,
            "step": self.step,
            "transitions": self.transitions,
            "updates": self.agent.updates,
            "seconds": round(self.seconds, 1),
        }

    def _save(self, name: str, score: Score, replay: dict[str, Any] | None = None) -> None:
        content = {
            "agent": self.agent.state(),
            "generator": self.generator.get_state(),
            "seed": self.seed,
            "phase": self.phase,
            "phase_step": self.phase_step,
            "best": self.best,
            "score": json.dumps(score.record()),
            "where": self._where(),
            "fraction": self.due,
            "replay": replay,
        }
        runs.save_checkpoint(self.folder / name, algorithm(self.settings.agent), content)

    def _restore(self) -> None:
        file = self.folder / runs.CHECKPOINT
        content = runs.load_checkpoint(file, algorithm(self.settings.agent))
        with runs.understood(file):
            self.agent.restore(content["agent"])
            self.generator.set_state(content["generator"])
            self.phase, self.phase_step = content["phase"], content["phase_step"]
            self.best, self.due = content["best"], content["fraction"]
            where = content["where"]
            self.step, self.transitions = where["step"], where["transitions"]
            self.seconds = where["seconds"]
            if content.get("replay") is not None:
                self._files.restore(content["replay"])


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

"""Training runs, and the loop that makes them: gather, learn, log, evaluate, save.

One loop serves every algorithm and any number of seeds side by side. Wherever a run is evaluated,
and so saved, new episodes begin: so a run that was killed and goes on from there is, bit by bit,
the run that was not. Beside those checkpoints the newest networks are kept every minute, the first
time after seconds, so that there is always something to export.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import torch

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.files import processor
from twinscrew.runtime.settings import convert
from twinscrew.training import evaluate, runs
from twinscrew.training.agents import algorithm, make_agent
from twinscrew.training.agents.base import Metrics
from twinscrew.training.collect import Collector
from twinscrew.training.evaluate import NetworkPolicy, Score
from twinscrew.training.learner import Alone, Learner, Stack
from twinscrew.training.logs import Logs, Progress
from twinscrew.training.replay import Step
from twinscrew.training.settings import PhaseSettings, TrainSettings, phase_settings

FIRST_LATEST_S, LATEST_EVERY_S = 8.0, 60.0
"""[s] When the newest networks are first kept, and how often from then on."""


class Training:
    """One seed's run in its directory: its agent, what it remembers, and how far it is."""

    def __init__(
        self,
        settings: TrainSettings,
        seed: int,
        folder: Path,
        device: str = "cpu",
        wandb: str | None = None,
        start: Path | None = None,
    ) -> None:
        self.settings, self.seed, self.folder, self.device = settings, seed, folder, device
        self._wandb, self._start = wandb, start
        self.agent = make_agent(settings.agent, seed, device)
        self.memory = self.agent.memory(settings)
        self.generator = torch.Generator().manual_seed(seed)
        self.phase = self.phase_step = self.step = self.transitions = 0
        self.due = self.seconds = 0.0
        self.best: float | None = None
        self.score: dict[str, Any] | None = None

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Claim the directory, go on from its checkpoint if it has one, and log."""
        plain = msgspec.to_builtins(self.settings)
        told = {"seed": self.seed, "settings": plain}
        runs.claim(self.folder, told, algorithm(self.settings.agent), complete)
        resumed = (self.folder / runs.CHECKPOINT).exists()
        if resumed:
            self._restore()
            runs.trim_log(self.folder / runs.LOG, self.step)
        elif self._start is not None:
            self._begin_from(self._start)
        with Logs(self.folder, plain, self.step, self._wandb) as self._logs:
            if not resumed:
                told = {} if self._start is None else {"begun_from": self._start.name}
                self._logs.write(
                    "start", seed=self.seed, machine=machine(), device=self.device, **told
                )
            yield
            if self.is_finished:
                self._logs.write("end", step=self.step, seconds=round(self.seconds, 1))

    def enter(self, number: int) -> PhaseSettings:
        """Begin a phase, or go on in it."""
        phase = self.settings.phases[number]
        if number > self.phase:
            self.phase, self.phase_step = number, 0
            if not phase.keep_replay:
                self.memory.clear()
        told = phase_settings(self.settings, phase)
        self.agent.retune(told.agent)
        return told

    def take(self, step: Step) -> None:
        """Keep what one more environment step gave."""
        self.transitions += self.memory.add(step)
        self.step += 1
        self.phase_step += 1

    def tell(self, metrics: Metrics, ended: list[tuple[float, bool]]) -> None:
        """Log an update's figures, the learning rates and the returns since the last time."""
        numbers = {name: round(float(value), 5) for name, value in metrics.items()}
        for name, optimizer in self.agent.optimizers.items():
            numbers[f"rate_{name.removesuffix('_optimizer')}"] = optimizer.param_groups[0]["lr"]
        if ended:
            numbers["return"] = round(sum(earned for earned, _ in ended) / len(ended), 4)
            numbers["arrived"] = round(sum(bool(home) for _, home in ended) / len(ended), 4)
        self._logs.write("train", **self._where(), **numbers)

    def evaluate(self) -> Score:
        """Evaluate, log, and write the checkpoints."""
        s = self.settings
        seen = s.environment
        network = self.agent.deployed(s.radius_margin)
        policy = NetworkPolicy(network, seen.period_s, seen.layout, seen.range_m)
        rough = phase_settings(s, s.phases[self.phase]).rough if s.rough_share > 0.0 else None
        kinds = dict.fromkeys(kind for row in seen.scenarios for kind in row.harbour)
        score = evaluate.validate(
            policy, s.evaluation_episodes, s.validation_seed, rough, tuple(kinds)
        )
        self.score = score.record()
        self._logs.write("evaluation", **self._where(), **self.score)
        if self.best is None or score.value > self.best:
            self.best = score.value
            self._save(runs.BEST)
        self.save()
        return score

    def save(self) -> Path:
        """Write the checkpoint that the run goes on from; give where."""
        kept = None
        if self.settings.save_replay:
            kept = self.memory.save(self.folder, finished=self.is_finished)
        self._save(runs.CHECKPOINT, kept)
        self.memory.tidy(self.folder)
        (self.folder / runs.LATEST).unlink(missing_ok=True)
        return self.folder / runs.CHECKPOINT

    def keep_latest(self) -> None:
        """Write the newest networks, to be exported: not what the run goes on from."""
        self._save(runs.LATEST)

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

    def _save(self, name: str, replay: dict[str, Any] | None = None) -> None:
        content = {
            "agent": self.agent.state(),
            "generator": self.generator.get_state(),
            "seed": self.seed,
            "phase": self.phase,
            "phase_step": self.phase_step,
            "best": self.best,
            "score": json.dumps(self.score),
            "where": self._where(),
            "fraction": self.due,
            "replay": replay,
        }
        runs.save_checkpoint(self.folder / name, algorithm(self.settings.agent), content)

    def _begin_from(self, file: Path) -> None:
        content = runs.load_checkpoint(file, algorithm(self.settings.agent))
        with runs.understood(file):
            self.agent.start_from(content["agent"])

    def _restore(self) -> None:
        file = self.folder / runs.CHECKPOINT
        content = runs.load_checkpoint(file, algorithm(self.settings.agent))
        with runs.understood(file):
            self.agent.restore(content["agent"])
            self.generator.set_state(content["generator"])
            self.phase, self.phase_step = content["phase"], content["phase_step"]
            self.best, self.due = content["best"], content["fraction"]
            self.score = json.loads(content["score"])
            where = content["where"]
            self.step, self.transitions = where["step"], where["transitions"]
            self.seconds = where["seconds"]
            if content.get("replay") is not None:
                self.memory.restore(self.folder, content["replay"])


def train(
    seeds: Sequence[Training],
    progress: Progress,
    *,
    steps: int | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Train the runs of one or more seeds, side by side, to the end of the last phase.

    Parameters
    ----------
    seeds
        One run each.
    progress
        Shown while it lasts.
    steps
        [environment steps] In all; the runs are evaluated and saved there, and may go on later.
    stopped
        Asked after every step; if so the runs are saved as they are, and may go on later.

    Raises
    ------
    ConfigError
        They are not equally far.
    """
    with ExitStack() as stack:
        for one in seeds:
            stack.enter_context(one.opened())
        if len({(one.phase, one.phase_step) for one in seeds}) > 1:
            far = ", ".join(f"seed {one.seed} at step {one.step}" for one in seeds)
            raise ConfigError(f"these runs are not equally far ({far}); go on one by one")
        Loop(seeds, progress, steps, stopped).run()


class Loop:
    """What `train` does: phase after phase, from one checkpoint to the next."""

    def __init__(
        self,
        seeds: Sequence[Training],
        progress: Progress,
        steps: int | None,
        stopped: Callable[[], bool],
    ) -> None:
        self.seeds, self.progress, self.stopped = seeds, progress, stopped
        self.first = first = seeds[0]
        self.settings = first.settings
        self.limit = steps or self.settings.steps
        agents = [one.agent for one in seeds]
        self.learner: Learner = Alone(agents[0]) if len(agents) == 1 else Stack(agents)
        self.started = time.monotonic() - first.seconds
        self.latest_at = time.monotonic() + FIRST_LATEST_S

    def run(self) -> None:
        """Go through the phases that are left."""
        first, phases = self.first, self.settings.phases
        for number in range(first.phase, len(phases)):
            told, *_ = [one.enter(number) for one in self.seeds]
            while first.phase_step < phases[number].steps:
                if first.step >= self.limit or not self._to_checkpoint(told, phases[number].steps):
                    return

    def _to_checkpoint(self, told: PhaseSettings, steps: int) -> bool:
        """Gather and learn until an evaluation is due; tell whether to go on after it."""
        s, first = self.settings, self.first
        rough = round(s.parallel_episodes * s.rough_share)
        kinds = [(told.calm, s.parallel_episodes - rough), (told.rough, rough)]
        numbers = [one.seed for one in self.seeds]
        agents = self.learner.agents
        collector = Collector(kinds, s.exploration, agents, numbers, first.step)
        for one in self.seeds:
            one.memory.begin(collector.slots)
        metrics: list[Metrics] = []
        while True:
            random = any(one.transitions < s.warm_up for one in self.seeds)
            steps_of = collector.step(self.learner, first.step, random=random)
            for one, step in zip(self.seeds, steps_of, strict=True):
                one.take(step)
            metrics = self._learn(first.phase_step / steps) or metrics
            for one in self.seeds:
                one.seconds = time.monotonic() - self.started
            loss = metrics[0]["critic_loss"] if metrics else None
            self.progress.advance(first.step, first.transitions, loss)
            if metrics and first.step % s.log_every == 0:
                for one, mine, ended in zip(self.seeds, metrics, collector.ended, strict=True):
                    one.tell(mine, ended)
                    ended.clear()
            over = first.phase_step == steps or first.step >= self.limit
            if over or first.step % s.evaluate_every == 0:
                break
            if self.stopped():
                self._save_all()
                return False
            if time.monotonic() >= self.latest_at:
                self.learner.settle()
                for one in self.seeds:
                    one.keep_latest()
                self.latest_at = time.monotonic() + LATEST_EVERY_S
        self.learner.settle()
        for one in self.seeds:
            self.progress.report(one.seed, one.step, one.evaluate())
        return not self.stopped()

    def _learn(self, progress: float) -> list[Metrics]:
        """Take the updates that are due, once every seed has gathered enough."""
        s, first = self.settings, self.first
        metrics: list[Metrics] = []
        ready = min(one.memory.ready(s.warm_up) for one in self.seeds)
        if not ready:
            return metrics
        if first.agent.on_policy:
            self.learner.settle()
        for one in self.seeds:
            one.memory.study(one.agent)
        due = first.due + s.updates_per_step * ready
        while due >= 1.0:
            drawn = [one.memory.sample(s.batch, one.generator) for one in self.seeds]
            metrics = self.learner.update(drawn, progress)
            share = first.step / s.steps
            for one, mine, told in zip(self.seeds, drawn, metrics, strict=True):
                one.memory.learnt(mine, told.pop("priority", None), share)
            due -= 1.0
        for one in self.seeds:
            one.due = due
            one.memory.done()
        return metrics

    def _save_all(self) -> None:
        self.learner.settle()
        for one in self.seeds:
            self.progress.say(f"stopped at step {one.step}: saved {one.save()}")


def complete(settings: dict[str, Any]) -> dict[str, Any]:
    """Fill in the defaults of settings as plain values; what cannot be read stays as it is."""
    try:
        known = convert(settings, TrainSettings)
    except ConfigError:
        return settings
    plain: dict[str, Any] = json.loads(json.dumps(msgspec.to_builtins(known)))
    return plain


def machine() -> str:
    """Say what the run is made on."""
    return f"{processor()}, {torch.get_num_threads()} thread(s), torch {torch.__version__}"

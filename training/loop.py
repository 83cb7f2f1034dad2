"""The training loop: gather, learn, log, evaluate, checkpoint; for every agent, for any seeds.

Wherever a run is evaluated, and so saved, new episodes begin: so a run that was cut off and goes on
from there is, bit by bit, the run that was not.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack

from twinscrew.runtime.errors import ConfigError
from twinscrew.training.agents.lesson import Metrics
from twinscrew.training.collect import Collector
from twinscrew.training.learner import Alone, Learner
from twinscrew.training.logs import Progress
from twinscrew.training.stack import Stack
from twinscrew.training.train import Training


def train(seeds: Sequence[Training], progress: Progress) -> None:
    """Train the runs of one or more seeds, side by side, to the end of the last phase.

    Raises
    ------
    ConfigError
        They are not equally far.
    """
    with ExitStack() as stack:
        for one in seeds:
            stack.enter_context(one.opened())
        if len({(one.phase, one.phase_step) for one in seeds}) > 1:
            told = ", ".join(f"seed {one.seed} at step {one.step}" for one in seeds)
            raise ConfigError(f"these runs are not equally far ({told}); go on one by one")
        agents = [one.agent for one in seeds]
        learner = Alone(agents[0]) if len(agents) == 1 else Stack(agents)
        for number in range(seeds[0].phase, len(seeds[0].settings.phases)):
            _phase(number, seeds, learner, progress)


def _phase(number: int, seeds: Sequence[Training], learner: Learner, progress: Progress) -> None:
    told, *_ = [one.enter(number) for one in seeds]
    first = seeds[0]
    s, steps = first.settings, first.settings.phases[number].steps
    started = time.monotonic() - first.seconds
    metrics: list[Metrics] = []
    while first.phase_step < steps:
        collector = Collector(s, told, [one.seed for one in seeds], first.step)
        while True:
            _gather(seeds, learner, collector)
            metrics = _learn(seeds, learner, first.phase_step / steps) or metrics
            for one in seeds:
                one.seconds = time.monotonic() - started
            progress.advance(first.step)
            if metrics and first.step % s.log_every == 0:
                for one, mine in zip(seeds, metrics, strict=True):
                    one.tell(mine)
            if first.step % s.evaluate_every == 0 or first.phase_step == steps:
                break
        learner.settle()
        for one in seeds:
            progress.report(one.seed, one.step, one.evaluate())


def _gather(seeds: Sequence[Training], learner: Learner, collector: Collector) -> None:
    warm_up = seeds[0].settings.warm_up
    random = any(one.transitions < warm_up for one in seeds)
    for one, rows in zip(seeds, collector.step(learner, seeds[0].step, random=random), strict=True):
        one.take(rows)


def _learn(seeds: Sequence[Training], learner: Learner, progress: float) -> list[Metrics]:
    """Take the updates that are due, once every seed has gathered enough."""
    metrics: list[Metrics] = []
    if any(len(one.replay) < one.settings.warm_up for one in seeds):
        return metrics
    due = seeds[0].due + seeds[0].settings.updates_per_step
    while due >= 1.0:
        drawn = [one.draw() for one in seeds]
        metrics = learner.update(drawn, progress)
        for one, mine, told in zip(seeds, drawn, metrics, strict=True):
            one.reprioritise(mine, told)
        due -= 1.0
    for one in seeds:
        one.due = due
    return metrics

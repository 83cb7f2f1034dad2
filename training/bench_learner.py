"""How fast the shipped configuration's agent learns, on one thread."""

from __future__ import annotations

import time

import torch

from twinscrew.runtime.settings import shipped

WARM_UP, UPDATES = 10, 50


def update_speed(config: str = "ac_iqn") -> dict[str, float]:
    """Time updates on random transitions.

    Returns
    -------
    update_ms
        [ms] Median processor time of one update, the draw from the replay included.
    samples_per_s
        [1/s] Transitions learnt from in that time.
    """
    from twinscrew.training.agents.registry import make_agent
    from twinscrew.training.buffer import TRANSITION_COLUMNS
    from twinscrew.training.train import make_replay
    from twinscrew.training.train_settings import load_training

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        settings = load_training(shipped("training", config))
        agent, replay = make_agent(settings.agent, 0, "cpu"), make_replay(settings)
        replay.add(torch.randn(100_000, TRANSITION_COLUMNS, generator=agent.generator))
        times = []
        for _ in range(WARM_UP + UPDATES):
            start = time.process_time()
            drawn = replay.sample(settings.batch, agent.generator)
            agent.update(drawn.batch(agent.device), 0.0)
            times.append(time.process_time() - start)
    finally:
        torch.set_num_threads(threads)
    seconds = sorted(times[WARM_UP:])[UPDATES // 2]
    return {"update_ms": seconds * 1e3, "samples_per_s": settings.batch / seconds}

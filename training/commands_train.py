"""`twinscrew train`: one run a seed, resumed where it was left."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer


def train(
    config: Annotated[str, typer.Argument(help="A TOML file, or a name in config/training.")],
    seeds: Annotated[str, typer.Option(help="As 0,1,2: one run each, one after another.")] = "0",
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    resume: Annotated[
        Path | None, typer.Option(help="Go on with the runs in this directory.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Where the runs go, as seed_0, seed_1, ...; default runs/train/CONFIG."),
    ] = None,
    together: Annotated[
        bool, typer.Option("--together", help="All seeds at once, their parameters stacked.")
    ] = False,
    threads: Annotated[int, typer.Option(min=1, help="Processor threads of torch.")] = 1,
) -> None:
    """Train policies; a run that was cut off goes on from its last checkpoint."""
    from twinscrew.runtime.errors import ConfigError, TwinscrewError

    try:
        import torch
    except ModuleNotFoundError as error:
        raise TwinscrewError("'train' needs torch: pip install 'twinscrew[train]'") from error
    from twinscrew.runtime.settings import shipped
    from twinscrew.training import runs
    from twinscrew.training.logs import Progress
    from twinscrew.training.loop import train as run
    from twinscrew.training.train import Training
    from twinscrew.training.train_settings import load_training, parse_seeds

    file = shipped("training", config)
    settings = load_training(file)
    chosen = parse_seeds(seeds)
    if device not in ("cpu", "cuda") or (device == "cuda" and not torch.cuda.is_available()):
        raise ConfigError(f"{device!r} is not one of the devices of this machine", key="--device")
    folder = resume or out or Path("runs") / "train" / file.stem
    if resume is not None and not list(resume.glob(f"seed_*/{runs.CHECKPOINT}")):
        raise ConfigError("no checkpoint to resume from", file=resume)
    torch.set_num_threads(threads)
    steps = sum(phase.steps for phase in settings.phases)
    for group in [chosen] if together else [[seed] for seed in chosen]:
        with ExitStack() as held:
            places = [folder / f"seed_{seed}" for seed in group]
            for place in places:
                held.enter_context(runs.locked(place))
            progress = held.enter_context(Progress(file.stem, steps))
            pairs = zip(group, places, strict=True)
            run([Training(settings, seed, place, device) for seed, place in pairs], progress)

"""`twinscrew train`: one run a seed, resumed where it was left."""

from __future__ import annotations

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
    for seed in chosen:
        place = folder / f"seed_{seed}"
        with runs.locked(place), Progress(f"{file.stem} seed {seed}", steps) as progress:
            Training(settings, seed, place, device).run(progress)

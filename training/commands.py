"""The training commands of `twinscrew`; each imports what it needs when it runs."""

from __future__ import annotations

from twinscrew.training.commands_evaluate import evaluate
from twinscrew.training.commands_train import train

__all__ = ["evaluate", "train"]

"""What is kept of experience: transitions in a ring, or rollouts for on-policy algorithms.

A transition is one row of numbers, written once, into the memory that batches are drawn from:
the observation's row, the action, the reward over n steps, the discount, the next observation.

The replay lies beside a checkpoint in files of the transitions that came since the one before. A
file, once written, never changes: so a run that is killed, or a disk that is full, leaves the last
checkpoint with all its files. A checkpoint lists the files that it needs; others are removed when
it has taken its place.
"""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from twinscrew.runtime.errors import ConfigError
from twinscrew.runtime.messages.types import Float32, Float64
from twinscrew.runtime.settings import Fraction, NonNegative, Settings
from twinscrew.training.networks import Observations, unpack
from twinscrew.training.perception import PAPER, Layout
from twinscrew.training.runs import replace_file
from twinscrew.training.scenarios import Index, Mask

if TYPE_CHECKING:
    from twinscrew.training.agents.base import Agent
    from twinscrew.training.settings import TrainSettings

TRANSITION_COLUMNS = 2 * sum(PAPER.widths) + 4
"""[-] Observation as the paper has it, action (2), reward, discount, next observation."""
FILES = "replay_*.npy"
BLOCK = 1024
"""[-] Transitions in a block of priorities; about the root of a million."""
_LEAST = 1e-6  # [-] keeps every transition possible


class PrioritySettings(Settings, frozen=True):
    """Prioritised replay (Schaul et al. 2016): surprises are drawn more often."""

    exponent: NonNegative = 0.5
    """[-] alpha: a transition is drawn in proportion to its loss to this power; 0 is uniform."""
    correction_start: Fraction = 0.4
    """[-] beta: how much of the bias of the draw its weight undoes, at first,"""
    correction_end: Fraction = 1.0
    """[-] and at the end."""


class Step(NamedTuple):
    """One decision of M slots (a slot is a place for a vessel in an episode)."""

    observation: Float32
    """(M, W) Rows that were acted on."""
    action: Float32
    """(M, 2) in [-1, 1]."""
    reward: Float32
    """(M,)"""
    terminated: Mask
    """(M,) Goal or collision: nothing follows."""
    truncated: Mask
    """(M,) Time is up: the return goes on beyond what was seen."""
    active: Mask
    """(M,) Slots that held a sailing vessel when the step began."""
    next_observation: Float32
    """(M, W) After the step, before any reset."""


class Batch(NamedTuple):
    """B transitions."""

    observations: Observations
    action: Tensor
    """(B, 2) in [-1, 1]."""
    reward: Tensor
    """(B,) Discounted sum over the n steps."""
    discount: Tensor
    """(B,) gamma^n; 0 where the episode ended, so that nothing is bootstrapped."""
    next_observations: Observations
    weight: Tensor | None = None
    """(B,) Of each sample's loss, where transitions are drawn by priority."""
    extra: Tensor | None = None
    """(B, X) What an on-policy algorithm's `study` gave."""


def split_rows(rows: Tensor) -> Batch:
    """Read transitions, (..., B, W), as a batch."""
    width = (rows.shape[-1] - 4) // 2
    widths = [width, 2, 1, 1, width]
    first, action, reward, discount, last = torch.split(rows, widths, dim=-1)
    return Batch(unpack(first), action, reward.squeeze(-1), discount.squeeze(-1), unpack(last))


class Drawn(NamedTuple):
    """Transitions drawn from a memory."""

    rows: Tensor
    """(B, W)"""
    weight: Tensor | None = None
    """(B,) Of each sample's loss, where they are drawn by priority."""
    places: Tensor | None = None
    """(B,) Where they lie in the replay, where they are drawn by priority."""
    extra: Tensor | None = None
    """(B, X) What an on-policy algorithm's `study` gave."""

    def batch(self, device: torch.device) -> Batch:
        """Give them on a device, moved there at once."""
        weight, extra = (p if p is None else p.to(device) for p in (self.weight, self.extra))
        return split_rows(self.rows.to(device))._replace(weight=weight, extra=extra)


class Memory(Protocol):
    """What the training loop asks of a replay or a rollout."""

    def begin(self, slots: int) -> None:
        """Forget what is unfinished: fresh episodes begin, with so many slots."""

    def add(self, step: Step) -> int:
        """Take in a decision of all slots; give how many transitions are now complete."""

    def ready(self, warm_up: int) -> int:
        """Give how many steps' updates may be made now, 0: none yet."""

    def study(self, agent: Agent[Any]) -> None:
        """Prepare for the updates of `ready`."""

    def sample(self, count: int, generator: torch.Generator) -> Drawn:
        """Draw transitions for an update."""

    def learnt(self, drawn: Drawn, losses: Tensor | None, progress: float) -> None:
        """Take in each sample's loss, (B,), and how far the run is, in [0, 1]."""

    def done(self) -> None:
        """Take note that the updates of `ready` have been made."""

    def clear(self) -> None:
        """Forget everything: after a change of the rewards."""

    def save(self, folder: Path, *, finished: bool) -> dict[str, Any] | None:
        """Write what is new beside a checkpoint, and give what the checkpoint has to hold."""

    def restore(self, folder: Path, kept: dict[str, Any]) -> None:
        """Take back what a checkpoint kept."""

    def tidy(self, folder: Path) -> None:
        """Remove the files that the checkpoint, now in its place, does not need."""


class Replay:
    """The last `capacity` transitions over up to n steps, drawn uniformly.

    A transition is complete when n steps have followed its start, or as soon as the vessel's
    trajectory ends: so every step that a vessel sailed becomes exactly one, but those still open.
    """

    def __init__(
        self,
        capacity: int,
        steps: int = 1,
        discount: float = 0.99,
        layout: Layout = PAPER,
    ) -> None:
        self.rows = torch.zeros(capacity, 2 * sum(layout.widths) + 4)
        self.added = 0
        """[-] Transitions since the last `clear`: number n lies in place n modulo the capacity."""
        self.cleared = 0
        """[-] How often the buffer was emptied."""
        self.discount = discount
        self._steps: deque[Step] = deque(maxlen=steps)
        self._length = np.zeros(1, dtype=np.int64)
        self._parts: list[tuple[int, int]] = []  # files: number of the first, and past the last
        self._written = 0  # value of `cleared` that the files are of

    def __len__(self) -> int:
        return min(self.added, len(self.rows))

    def begin(self, slots: int) -> None:
        """Forget the open starts."""
        self._steps.clear()
        self._length = np.zeros(slots, dtype=np.int64)

    def add(self, step: Step) -> int:
        """Take in a decision; write the transitions that are now complete."""
        self._steps.append(step)
        self._length = np.where(step.active, self._length + 1, 0)
        done = step.terminated | step.truncated
        going_on = np.where(step.terminated, 0.0, 1.0)
        reward = np.zeros(len(step.reward))
        first = self.added
        for back, start in enumerate(reversed(self._steps)):
            reward = start.reward + self.discount * reward
            oldest = back + 1 == self._steps.maxlen
            ready = np.flatnonzero((self._length > back) & (done | oldest))
            self._write(start, reward, self.discount ** (back + 1) * going_on, step, ready)
        self._length[done] = 0
        return self.added - first

    def _write(
        self, start: Step, reward: Float64, discount: Float64, end: Step, slots: Index
    ) -> Tensor:
        """Write transitions of some slots into the ring; the oldest make room. Gives the places."""
        capacity, width = len(self.rows), start.observation.shape[-1]
        slots = slots[-capacity:]
        places = (np.arange(len(slots)) + self.added) % capacity
        rows = self.rows.numpy()
        rows[places, :width] = start.observation[slots]
        rows[places, width : width + 2] = start.action[slots]
        rows[places, width + 2] = reward[slots]
        rows[places, width + 3] = discount[slots]
        rows[places, width + 4 :] = end.next_observation[slots]
        self.added += len(slots)
        return torch.from_numpy(places)

    def ready(self, warm_up: int) -> int:
        """Give 1 once there are `warm_up` transitions."""
        return int(len(self) >= warm_up)

    def study(self, agent: Agent[Any]) -> None:
        """Do nothing: transitions speak for themselves."""

    def sample(self, count: int, generator: torch.Generator) -> Drawn:
        """Draw `count` transitions uniformly, with replacement."""
        places = torch.randint(len(self), (count,), generator=generator)
        return Drawn(self.rows[places])

    def learnt(self, drawn: Drawn, losses: Tensor | None, progress: float) -> None:
        """Do nothing: the draw is uniform."""

    def done(self) -> None:
        """Do nothing: transitions serve many updates."""

    def clear(self) -> None:
        """Forget every transition."""
        self.added = 0
        self.cleared += 1

    def state(self) -> dict[str, Any]:
        """Give what there is to remember beside the transitions."""
        return {"added": self.added, "cleared": self.cleared}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take a `state` back; the transitions are in their places."""
        self.added, self.cleared = state["added"], state["cleared"]

    def save(self, folder: Path, *, finished: bool) -> dict[str, Any] | None:
        """Write what is new; a finished run needs none of it.

        Raises
        ------
        TwinscrewError
            It cannot be written; what was there before is untouched.
        """
        if finished:
            self._parts = []
            return None
        if self.cleared != self._written:
            self._written, self._parts = self.cleared, []
        capacity, written = len(self.rows), self._parts[-1][1] if self._parts else 0
        first = max(written, self.added - capacity)
        parts = [part for part in self._parts if part[1] > self.added - capacity]
        if self.added > first:
            rows = self.rows[torch.arange(first, self.added) % capacity].numpy()
            replace_file(self._file(folder, first), lambda out: np.save(out, rows))
            parts.append((first, self.added))
        self._parts = parts
        return {"state": self.state(), "parts": [list(part) for part in parts]}

    def restore(self, folder: Path, kept: dict[str, Any]) -> None:
        """Take back what a checkpoint kept.

        Raises
        ------
        ConfigError
            A file is missing or is not what was written.
        """
        self._written = int(kept["state"]["cleared"])
        self._parts = [(int(first), int(end)) for first, end in kept["parts"]]
        for first, end in self._parts:
            file = self._file(folder, first)
            try:
                rows = torch.from_numpy(np.load(file, allow_pickle=False))
                self.rows[torch.arange(first, end) % len(self.rows)] = rows
            except (OSError, ValueError, RuntimeError, IndexError) as error:
                raise ConfigError(f"replay cannot be read: {error}", file=file) from error
        self.set_state(kept["state"])

    def tidy(self, folder: Path) -> None:
        """Remove the files that the checkpoint, now in its place, does not need."""
        needed = {self._file(folder, first) for first, _ in self._parts}
        for file in set(folder.glob(FILES)) - needed:
            file.unlink()

    def _file(self, folder: Path, first: int) -> Path:
        return folder / f"replay_{self._written}_{first}.npy"


class PrioritisedReplay(Replay):
    """A replay that draws by priority; new transitions have the greatest seen so far.

    Priorities lie in blocks whose sums are kept: a draw finds its block among their running sums,
    then its place in the block, for the whole batch at once.
    """

    def __init__(
        self,
        settings: PrioritySettings,
        capacity: int,
        steps: int = 1,
        discount: float = 0.99,
        layout: Layout = PAPER,
    ) -> None:
        super().__init__(capacity, steps, discount, layout)
        self.settings = settings
        self.correction = settings.correction_start
        blocks = -(-capacity // BLOCK)
        self._priority = torch.zeros(blocks, BLOCK, dtype=torch.float64)
        self._sums = torch.zeros(blocks, dtype=torch.float64)
        self._greatest = 1.0

    def clear(self) -> None:
        """Forget every transition and priority."""
        super().clear()
        self._priority.zero_()
        self._sums.zero_()

    def _write(
        self, start: Step, reward: Float64, discount: Float64, end: Step, slots: Index
    ) -> Tensor:
        places = super()._write(start, reward, discount, end, slots)
        self._assign(places, torch.full((len(places),), self._greatest, dtype=torch.float64))
        return places

    def sample(self, count: int, generator: torch.Generator) -> Drawn:
        """Draw `count` transitions by priority, with weights (N P)^-beta, the greatest 1."""
        ends = self._sums.cumsum(0)
        aim = torch.rand(count, generator=generator, dtype=torch.float64) * ends[-1]
        block = torch.searchsorted(ends, aim, right=True).clamp(max=len(ends) - 1)
        inner = self._priority[block].cumsum(1)
        rest = (aim - ends[block] + self._sums[block])[:, None]
        column = torch.searchsorted(inner, rest, right=True).squeeze(1).clamp(max=BLOCK - 1)
        places = (block * BLOCK + column).clamp(max=len(self) - 1)
        share = self._priority.view(-1)[places] / ends[-1]
        weight = (len(self) * share).clamp(min=_LEAST) ** -self.correction
        return Drawn(self.rows[places], (weight / weight.max()).float(), places)

    def learnt(self, drawn: Drawn, losses: Tensor | None, progress: float) -> None:
        """Set priorities from the losses, (B,), that an update gave; beta rises linearly.

        Raises
        ------
        ConfigError
            The algorithm gives no losses of samples.
        """
        if losses is None or drawn.places is None:
            raise ConfigError("this agent gives no priorities; leave the table out", key="priority")
        priority = (losses.double().cpu().abs() + _LEAST) ** self.settings.exponent
        self._greatest = max(self._greatest, float(priority.max()))
        self._assign(drawn.places, priority)
        s = self.settings
        self.correction = s.correction_start + progress * (s.correction_end - s.correction_start)

    def state(self) -> dict[str, Any]:
        """Give priorities too."""
        used = self._priority.view(-1)[: len(self)].clone()
        more = {"priority": used, "greatest": self._greatest, "correction": self.correction}
        return super().state() | more

    def set_state(self, state: dict[str, Any]) -> None:
        """Take a `state` back."""
        super().set_state(state)
        self._greatest, self.correction = state["greatest"], state["correction"]
        self._assign(torch.arange(len(self)), state["priority"])

    def _assign(self, places: Tensor, priority: Tensor) -> None:
        self._priority.view(-1)[places] = priority
        blocks = torch.unique(places // BLOCK)
        self._sums[blocks] = self._priority[blocks].sum(1)


class Rollout:
    """All decisions of the last `horizon` steps, for algorithms that learn on-policy.

    Updates draw from it in random order, each transition once before any comes again; then it is
    forgotten. Nothing of it is kept in a checkpoint: fresh episodes begin there anyway.
    """

    def __init__(self, horizon: int, discount: float) -> None:
        self.horizon, self.discount = horizon, discount
        self._steps: list[Step] = []
        self._rows = torch.zeros(0, TRANSITION_COLUMNS)
        self._extra = torch.zeros(0, 0)
        self._order = torch.zeros(0, dtype=torch.long)

    def begin(self, slots: int) -> None:  # noqa: ARG002
        """Forget an unfinished rollout."""
        self._steps = []

    def clear(self) -> None:
        """Forget it."""
        self._steps = []

    done = clear

    def add(self, step: Step) -> int:
        """Take in a decision; every active slot's is a transition."""
        self._steps.append(step)
        return int(step.active.sum())

    def ready(self, warm_up: int) -> int:  # noqa: ARG002
        """Give the horizon once it is reached."""
        return self.horizon if len(self._steps) >= self.horizon else 0

    def study(self, agent: Agent[Any]) -> None:
        """Lay the rollout out as rows, step by step, and let the agent study it."""
        self._where = np.stack([step.active for step in self._steps])
        parts = []
        for step in self._steps:
            going_on = np.where(step.terminated, 0.0, self.discount)
            columns = (step.action, step.reward[:, None], going_on[:, None])
            whole = [step.observation, *columns, step.next_observation]
            parts.append(np.concatenate(whole, axis=1, dtype=np.float32)[step.active])
        self._rows = torch.from_numpy(np.concatenate(parts))
        self._extra, self._order = agent.study(self), self._order[:0]

    def batch(self, device: torch.device) -> Batch:
        """Give all transitions, (n, ...), step by step."""
        return Drawn(self._rows).batch(device)

    def accumulate(self, delta: Tensor, trace: float) -> Tensor:
        """Give A_t = delta_t + gamma lambda A_t+1 along every vessel's way, (n,) both."""
        whole = np.zeros(self._where.shape)
        whole[self._where] = delta.double().numpy()
        running = np.zeros(self._where.shape[1])
        for t in reversed(range(len(whole))):
            over = self._steps[t].terminated | self._steps[t].truncated
            running = whole[t] + self.discount * trace * np.where(over, 0.0, running)
            running *= self._where[t]
            whole[t] = running
        return torch.from_numpy(whole[self._where].astype(np.float32))

    def sample(self, count: int, generator: torch.Generator) -> Drawn:
        """Draw `count` transitions, none twice before all have come."""
        while len(self._order) < count:
            fresh = torch.randperm(len(self._rows), generator=generator)
            self._order = torch.cat([self._order, fresh])
        places, self._order = self._order[:count], self._order[count:]
        return Drawn(self._rows[places], extra=self._extra[places])

    def learnt(self, drawn: Drawn, losses: Tensor | None, progress: float) -> None:
        """Do nothing: all count the same."""

    def save(self, folder: Path, *, finished: bool) -> dict[str, Any] | None:  # noqa: ARG002
        """Keep nothing."""
        return None

    def restore(self, folder: Path, kept: dict[str, Any]) -> None:
        """Do nothing: nothing is kept."""

    def tidy(self, folder: Path) -> None:
        """Do nothing: there are no files."""


def make_replay(settings: TrainSettings) -> Replay:
    """Build the replay that the settings name."""
    shape = (settings.replay, settings.n_steps, settings.discount, settings.environment.layout)
    if settings.priority is not None:
        return PrioritisedReplay(settings.priority, *shape)
    return Replay(*shape)

"""Replay: what a recording's core took in, taken in again, gives the same decisions."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from twinscrew.runtime.app.assemble import make_core
from twinscrew.runtime.app.config import RuntimeConfig, load_config
from twinscrew.runtime.app.core import Core
from twinscrew.runtime.app.recording import DecisionHash, Recording
from twinscrew.runtime.errors import RecordingError
from twinscrew.runtime.messages import cdr
from twinscrew.runtime.messages.types import Engagement
from twinscrew.runtime.settings import convert


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """What a replay gave."""

    vessel: str
    decisions: int
    sha256: str
    recorded_decisions: int
    recorded_sha256: str
    """Of the decisions in the recording."""
    beginning_sha256: str
    """Of as many replayed decisions as were recorded."""
    whole: bool
    """False if the recording's end is missing: the recorder was killed."""

    @property
    def same(self) -> bool:
        """True if every recorded decision came out again, bit for bit, and no other.

        Where the recording's end is missing, the decisions on its last inputs may be, too.
        """
        again = self.sha256 if self.whole else self.beginning_sha256
        return again == self.recorded_sha256


def replay(
    recording: Recording, *, config: Path | None = None, policy: str | None = None
) -> Replay:
    """Feed a recording to the core again.

    Parameters
    ----------
    recording
        One vessel's.
    config
        A runtime's TOML file to use instead of the recorded configuration; needed for recordings
        made elsewhere that are not to be decided on by the defaults.
    policy
        A policy to use instead of the recorded one.

    Raises
    ------
    RecordingError
        The recording is damaged, or was made with another policy file of that name.
    TwinscrewError
        The configuration or the policy cannot be used.
    """
    core = _core_of(recording, config, policy)
    recorded = DecisionHash()
    recorded_count = 0
    for payload in _recorded_decisions(recording):
        recorded.add(payload)
        recorded_count += 1
    again = DecisionHash()
    count, beginning = 0, again.hexdigest()
    if not _has_engagement(recording):  # made elsewhere: decide as if the boat were ours
        core.feed("engagement", cdr.encode_engagement(Engagement(stamp_ns=0, engaged=True)))
    for message in recording.inputs():
        outcome = core.feed(message.topic, message.payload)
        if outcome.decision is not None:
            again.add(cdr.encode_decision(outcome.decision))
            count += 1
            if count == recorded_count:
                beginning = again.hexdigest()
    return Replay(
        vessel=recording.vessel,
        decisions=count,
        sha256=again.hexdigest(),
        recorded_decisions=recorded_count,
        recorded_sha256=recorded.hexdigest(),
        beginning_sha256=beginning,
        whole=recording.whole,
    )


def combined_sha256(digests: Iterable[str]) -> str:
    """Give one SHA-256 for several vessels' digests, in their order; a single one is itself."""
    several = tuple(digests)
    if len(several) == 1:
        return several[0]
    return hashlib.sha256("".join(several).encode("ascii")).hexdigest()


def _core_of(recording: Recording, config: Path | None, policy: str | None) -> Core:
    if config is not None:
        settings = load_config(config)
    else:
        values = recording.metadata.get("config", {})
        settings = convert(values, RuntimeConfig, file=recording.path)
    if policy is not None:
        values = {**_plain(settings), "policy": policy}
        settings = convert(values, RuntimeConfig, file=recording.path)
    core = make_core(settings)
    expected = recording.metadata.get("policy_sha256", "")
    found = getattr(core.pipeline.policy, "sha256", "")
    if policy is None and expected and found != expected:
        raise RecordingError(
            f"{recording.path}: made with a policy of SHA-256 {expected[:12]}..., but "
            f"{settings.policy} is now {found[:12]}...; name the file with --policy"
        )
    return core


def _plain(settings: RuntimeConfig) -> dict[str, object]:
    import msgspec

    plain: dict[str, object] = msgspec.to_builtins(settings)
    return plain


def _topics(recording: Recording) -> set[str]:
    return {message.topic for message in recording.messages()}


def _has_engagement(recording: Recording) -> bool:
    return "engagement" in _topics(recording)


def _recorded_decisions(recording: Recording) -> Iterable[bytes]:
    return recording.decisions() if "decision" in _topics(recording) else ()

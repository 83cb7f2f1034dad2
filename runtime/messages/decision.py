"""CDR of a decision, and of the sentence that explains it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from twinscrew.runtime.messages.navigation import STAMP
from twinscrew.runtime.messages.types import (
    OBSERVED_OBJECTS,
    Decision,
    Explanation,
    HealthEvent,
    Objects,
    Observation,
    Severity,
    Tracks,
)
from twinscrew.runtime.messages.wire import (
    FLAG,
    STRING,
    Kind,
    Layout,
    Reader,
    Writer,
    array,
    choice,
    number,
    vector,
)

# -- `twinscrew_msgs/Decision`: everything a decision was made from, bit for bit.
#
# The bytes are canonical: equal decisions give equal bytes, so that the hash over a run's encoded
# decisions is the hash of the run. Arrays keep the frames of `types` (NED, FRD): this message is
# our own, and nothing may be lost by turning axes.


DECISION_TYPE: Final = "twinscrew_msgs/msg/Decision"

_EGO: Final = 7
_OBJECT: Final = 5
_SMALLEST_EVENT: Final = 20
"""[B] A stamp, two empty strings, and a severity with the padding before the second."""


def _read_observation(reader: Reader) -> Observation:
    size = OBSERVED_OBJECTS * _OBJECT
    numbers = np.array(reader.values(f"{_EGO + size + OBSERVED_OBJECTS}f", 4), np.float32)
    ego, objects, mask = np.split(numbers, (_EGO, _EGO + size))
    return Observation(ego=ego, objects=objects.reshape(OBSERVED_OBJECTS, _OBJECT), mask=mask)


def _write_observation(writer: Writer, observation: Observation | None) -> None:
    ego = np.zeros(_EGO) if observation is None else observation.ego
    objects, mask = np.zeros((OBSERVED_OBJECTS, _OBJECT)), np.zeros(OBSERVED_OBJECTS)
    if observation is not None:  # the nearest five, as circles: all tracks are in the message too
        count = min(OBSERVED_OBJECTS, len(observation.mask))
        objects[:count], mask[:count] = observation.objects[:count], observation.mask[:count]
    numbers = np.concatenate((ego, objects.ravel(), mask), dtype=np.float32)
    writer.values(f"{numbers.size}f", 4, *numbers.tolist())


def _decision(*, observed: bool, observation: Observation, **values: Any) -> Decision:
    return Decision(observation=observation if observed else None, **values)


_EVENT: Final = Layout(
    HealthEvent,
    stamp_ns=STAMP,
    name=STRING,
    severity=choice((Severity.INFO, Severity.WARNING, Severity.ERROR), "severity"),
    detail=STRING,
)
_OBJECTS: Final = Layout(
    Objects,
    alike="objects",
    stamp_ns=STAMP,
    p_L=array(np.float64, 2),
    radius=array(np.float64),
    points=array(np.int64),
)
_TRACKS: Final = Layout(
    Tracks,
    alike="tracks",
    stamp_ns=STAMP,
    id=array(np.int64),
    p_N=array(np.float64, 2),
    v_N=array(np.float64, 2),
    radius=array(np.float64),
    covariance=array(np.float64, 4, 4),
    age_s=array(np.float64),
)
_DECISION: Final = Layout(
    _decision,
    DECISION_TYPE,
    stamp_ns=STAMP,
    sequence=number("Q"),
    acted=FLAG,
    arrived=FLAG,
    observed=FLAG,
    thrust_rate=vector(2),
    thrust=vector(2),
    observation=Kind(_read_observation, _write_observation),
    objects=_OBJECTS.kind,
    tracks=_TRACKS.kind,
    events=_EVENT.sequence(_SMALLEST_EVENT),
)


def encode_decision(decision: Decision) -> bytes:
    """Write a twinscrew_msgs/Decision."""
    return _DECISION.encode(decision)


def decode_decision(payload: bytes | memoryview) -> Decision:
    """Read a twinscrew_msgs/Decision; `encode_decision` of it gives the same bytes."""
    return _DECISION.decode(payload)


# -- `twinscrew_msgs/Explanation`: what the vessel is doing and why, in words and numbers.

EXPLANATION_TYPE: Final = "twinscrew_msgs/msg/Explanation"
_EXPLANATION: Final = Layout(
    Explanation,
    EXPLANATION_TYPE,
    stamp_ns=STAMP,
    sequence=number("Q"),
    sentence=STRING,
    track=number("q"),
    rule=number("B"),
    cpa_m=number("d"),
    tcpa_s=number("d"),
)


def encode_explanation(said: Explanation) -> bytes:
    """Write a twinscrew_msgs/Explanation."""
    return _EXPLANATION.encode(said)


def decode_explanation(payload: bytes | memoryview) -> Explanation:
    """Read a twinscrew_msgs/Explanation; a `MessageError` if it is none."""
    return _EXPLANATION.decode(payload)

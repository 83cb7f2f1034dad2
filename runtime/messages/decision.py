"""CDR of a decision, and of the sentence that explains it."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from twinscrew.runtime.messages.navigation import read_stamp, write_stamp
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
from twinscrew.runtime.messages.wire import Reader, Writer

# -- `twinscrew_msgs/Decision`: everything a decision was made from, bit for bit.
#
# The bytes are canonical: equal decisions give equal bytes, so that the hash over a run's encoded
# decisions is the hash of the run. Arrays keep the frames of `types` (NED, FRD): this message is
# our own, and nothing may be lost by turning axes.


DECISION_TYPE: Final = "twinscrew_msgs/msg/Decision"

_SEVERITIES: Final = (Severity.INFO, Severity.WARNING, Severity.ERROR)
_EGO: Final = 7
_OBJECT: Final = 5
_SMALLEST_EVENT: Final = 20
"""[B] A stamp, two empty strings, and a severity with the padding before the second."""


def encode_decision(decision: Decision) -> bytes:
    """Write a twinscrew_msgs/Decision."""
    writer = Writer()
    write_stamp(writer, decision.stamp_ns)
    flags = (decision.acted, decision.arrived, decision.observation is not None)
    writer.values("Q", 8, decision.sequence)
    writer.values("3?", 1, *flags)
    writer.values("4d", 8, *decision.thrust_rate.tolist(), *decision.thrust.tolist())
    _write_observation(writer, decision.observation)
    _write_objects(writer, decision.objects)
    _write_tracks(writer, decision.tracks)
    writer.values("I", 4, len(decision.events))
    for event in decision.events:
        _write_event(writer, event)
    return writer.payload()


def decode_decision(payload: bytes | memoryview) -> Decision:
    """Read a twinscrew_msgs/Decision; `encode_decision` of it gives the same bytes."""
    reader = Reader(payload, DECISION_TYPE)
    stamp_ns = read_stamp(reader)
    (sequence,) = reader.values("Q", 8)
    acted, arrived, observed = reader.flag(), reader.flag(), reader.flag()
    rate_left, rate_right, left, right = reader.values("4d", 8)
    observation = _read_observation(reader)
    decision = Decision(
        stamp_ns=stamp_ns,
        sequence=sequence,
        acted=acted,
        thrust_rate=np.array((rate_left, rate_right)),
        thrust=np.array((left, right)),
        observation=observation if observed else None,
        objects=_read_objects(reader),
        tracks=_read_tracks(reader),
        events=tuple(_read_event(reader) for _ in range(reader.count(_SMALLEST_EVENT))),
        arrived=arrived,
    )
    reader.end()
    return decision


def _write_observation(writer: Writer, observation: Observation | None) -> None:
    ego = np.zeros(_EGO) if observation is None else observation.ego
    objects, mask = np.zeros((OBSERVED_OBJECTS, _OBJECT)), np.zeros(OBSERVED_OBJECTS)
    if observation is not None:  # the nearest five, as circles: all tracks are in the message too
        count = min(OBSERVED_OBJECTS, len(observation.mask))
        objects[:count], mask[:count] = observation.objects[:count], observation.mask[:count]
    numbers = np.concatenate((ego, objects.ravel(), mask), dtype=np.float32)
    writer.values(f"{numbers.size}f", 4, *numbers.tolist())


def _read_observation(reader: Reader) -> Observation:
    size = OBSERVED_OBJECTS * _OBJECT
    numbers = np.array(reader.values(f"{_EGO + size + OBSERVED_OBJECTS}f", 4), np.float32)
    ego, objects, mask = np.split(numbers, (_EGO, _EGO + size))
    return Observation(ego=ego, objects=objects.reshape(OBSERVED_OBJECTS, _OBJECT), mask=mask)


def _write_objects(writer: Writer, objects: Objects) -> None:
    write_stamp(writer, objects.stamp_ns)
    writer.array(objects.p_L, np.float64)
    writer.array(objects.radius, np.float64)
    writer.array(objects.points, np.int64)


def _read_objects(reader: Reader) -> Objects:
    objects = Objects(
        stamp_ns=read_stamp(reader),
        p_L=reader.array(np.float64, (2,)),
        radius=reader.array(np.float64),
        points=reader.array(np.int64),
    )
    _check_lengths(reader, "objects", (objects.p_L, objects.radius, objects.points))
    return objects


def _write_tracks(writer: Writer, tracks: Tracks) -> None:
    write_stamp(writer, tracks.stamp_ns)
    writer.array(tracks.id, np.int64)
    for numbers in (tracks.p_N, tracks.v_N, tracks.radius, tracks.covariance, tracks.age_s):
        writer.array(numbers, np.float64)


def _read_tracks(reader: Reader) -> Tracks:
    tracks = Tracks(
        stamp_ns=read_stamp(reader),
        id=reader.array(np.int64),
        p_N=reader.array(np.float64, (2,)),
        v_N=reader.array(np.float64, (2,)),
        radius=reader.array(np.float64),
        covariance=reader.array(np.float64, (4, 4)),
        age_s=reader.array(np.float64),
    )
    moving = (tracks.id, tracks.p_N, tracks.v_N, tracks.radius, tracks.covariance, tracks.age_s)
    _check_lengths(reader, "tracks", moving)
    return tracks


def _check_lengths(reader: Reader, what: str, arrays: tuple[NDArray[Any], ...]) -> None:
    if len({len(array) for array in arrays}) > 1:
        raise reader.fail(f"the arrays of its {what} differ in length")


def _write_event(writer: Writer, event: HealthEvent) -> None:
    write_stamp(writer, event.stamp_ns)
    writer.string(event.name)
    writer.values("B", 1, _SEVERITIES.index(event.severity))
    writer.string(event.detail)


def _read_event(reader: Reader) -> HealthEvent:
    stamp_ns, name, severity = read_stamp(reader), reader.string(), reader.uint8()
    if severity >= len(_SEVERITIES):
        raise reader.fail(f"{severity} is not a severity")
    detail = reader.string()
    return HealthEvent(stamp_ns=stamp_ns, name=name, severity=_SEVERITIES[severity], detail=detail)


# -- `twinscrew_msgs/Explanation`: what the vessel is doing and why, in words and numbers.

EXPLANATION_TYPE: Final = "twinscrew_msgs/msg/Explanation"


def encode_explanation(said: Explanation) -> bytes:
    """Write a twinscrew_msgs/Explanation."""
    writer = Writer()
    write_stamp(writer, said.stamp_ns)
    writer.values("Q", 8, said.sequence)
    writer.string(said.sentence)
    writer.values("q", 8, said.track)
    writer.values("B", 1, said.rule)
    writer.values("2d", 8, said.cpa_m, said.tcpa_s)
    return writer.payload()


def decode_explanation(payload: bytes | memoryview) -> Explanation:
    """Read a twinscrew_msgs/Explanation.

    Raises
    ------
    MessageError
        Not such a message.
    """
    reader = Reader(payload, EXPLANATION_TYPE)
    stamp_ns = read_stamp(reader)
    (sequence,) = reader.values("Q", 8)
    sentence = reader.string()
    (track,) = reader.values("q", 8)
    rule = reader.uint8()
    cpa_m, tcpa_s = reader.values("2d", 8)
    reader.end()
    return Explanation(
        stamp_ns=stamp_ns,
        sequence=sequence,
        sentence=sentence,
        track=track,
        rule=rule,
        cpa_m=cpa_m,
        tcpa_s=tcpa_s,
    )

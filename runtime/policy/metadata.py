"""What a policy file says about itself, checked."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M, SECTORS
from twinscrew.runtime.errors import PolicyError
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS
from twinscrew.runtime.policy.hull_units import HULL_COLUMNS
from twinscrew.runtime.settings import Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel

Text = Annotated[str, Meta(min_length=1)]

EXTENDED_INPUTS = ("outlines", "hull")
"""Beside the paper's: what the objects are shaped like, and what the own hull is."""
CONTOUR_INPUT = "contour"
"""How far off the nearest edge of what is fixed is, sector by sector (`charts.contour`)."""
OPTIONAL_INPUTS = ("risk", *EXTENDED_INPUTS, CONTOUR_INPUT)
MOST_OBJECTS = 32


def input_shapes(objects: int = OBSERVED_OBJECTS) -> dict[str, tuple[int, ...]]:
    """Give the inputs of a policy's graph, float32, without the batch dimension.

    `OPTIONAL_INPUTS` may be missing.
    """
    return {
        "ego": (7,),
        "objects": (objects, 5),
        "mask": (objects,),
        "risk": (1,),
        "outlines": (objects, 3),
        "hull": (len(HULL_COLUMNS),),
        CONTOUR_INPUT: (SECTORS,),
    }


OUTPUT_NAME = "thrust_rate"
OUTPUT_SHAPE = (2,)


class PolicyMetadata(msgspec.Struct, frozen=True, kw_only=True):
    """The metadata properties of a policy file; all are strings there. Others are ignored."""

    twinscrew_format: Literal["1"]
    """[-] Version of this table, the inputs and the output."""
    algorithm: Text
    """What trained it, as "ac_iqn"."""
    decision_period_s: Annotated[float, Meta(gt=0.0, le=10.0)]
    """[s] Time between two decisions."""
    thrust_min_n: Annotated[float, Meta(le=0.0)]
    """[N] Least thrust of each propeller in training."""
    thrust_max_n: Positive
    """[N] Greatest thrust of each propeller in training."""
    thrust_rate_max_n_per_s: Positive
    """[N/s] Greatest rate that the graph answers with."""
    observed_objects: Annotated[int, Meta(ge=1, le=MOST_OBJECTS)]
    """[-] Number of objects it sees."""
    perception_range_m: Positive
    """[m] How far it could see in training."""
    perception_range_min_m: float = 0.0
    """[m] If positive: it could see anything from this far to `perception_range_m`."""
    radius_margin: Positive
    """[-] Factor on observed radii, already applied inside the graph."""
    inputs: Text
    """JSON: name -> units, frame, shape."""
    training_run: Text
    commit: Text
    created: Text
    vessel: Text = load_vessel().name
    """The vessel that it was trained for, by its description's name, or "any": then everything that
    it sees, and its answer, is in the hull's own units (`hull_units`). Files that do not tell are
    the default vessel's."""

    @property
    def extended(self) -> bool:
        """Whether it takes the objects' outlines and the own hull's description."""
        return all(name in json.loads(self.inputs) for name in EXTENDED_INPUTS)

    @property
    def contour(self) -> bool:
        """Whether it takes the contour of what is fixed."""
        return CONTOUR_INPUT in json.loads(self.inputs)


class PolicyExpectation(Settings, frozen=True, kw_only=True):
    """What the vessel's configuration needs a policy to have been made for; None: anything."""

    thrust_min_n: float | None = None
    """[N]"""
    thrust_max_n: float | None = None
    """[N]"""
    perception_range_m: float | None = None
    """[m] How far the vessel sees: at least as far as the policy needs."""
    vessel: str | None = None
    """The name in the vessel's description."""


def read_metadata(properties: Mapping[str, str]) -> PolicyMetadata:
    """Check the metadata properties of a policy file.

    Raises
    ------
    PolicyError
        A key is missing, or its value is not what it has to be; names the key.
    """
    for key in PolicyMetadata.__struct_fields__:
        if key not in properties:
            if key in _OPTIONAL:
                continue
            needed = ", ".join(key for key in _TYPES if key not in _OPTIONAL)
            raise PolicyError(f"metadata {key!r} is missing; needed: {needed}")
        try:
            msgspec.convert(properties[key], _TYPES[key], strict=False)
        except msgspec.ValidationError as error:
            raise PolicyError(f"metadata {key!r}: {error}, got {properties[key]!r}") from error
    metadata = msgspec.convert(dict(properties), PolicyMetadata, strict=False)
    for key in metadata.__struct_fields__:
        value = getattr(metadata, key)
        if isinstance(value, float) and not math.isfinite(value):
            raise PolicyError(f"metadata {key!r} is {value}; expected a finite number")
    _check_inputs(metadata.inputs, metadata.observed_objects)
    return metadata


def check_expectation(metadata: PolicyMetadata, expect: PolicyExpectation) -> None:
    """Refuse a policy that was made for another vessel or sensor.

    Raises
    ------
    PolicyError
        Names the key, the policy's value and the vessel's.
    """
    if expect.vessel is not None and metadata.vessel not in (expect.vessel, "any"):
        raise PolicyError(
            f"trained for {metadata.vessel!r}; the vessel is {expect.vessel!r}: allowed are apf, "
            "mpc, or a policy trained for it"
        )
    if metadata.vessel == "any":  # its thrusts and ranges are in the hull's own units
        return
    for key in ("thrust_min_n", "thrust_max_n"):
        needed, given = getattr(expect, key), getattr(metadata, key)
        if needed is not None and needed != given:
            raise PolicyError(f"metadata {key!r} is {given:g}; the vessel's is {needed:g}")
    # What lies farther than it could see in training is not shown to it (`observation.Shown`).
    sees, least = expect.perception_range_m, metadata.perception_range_min_m
    if sees is not None and sees < (least or metadata.perception_range_m):
        key = "perception_range_min_m" if least else "perception_range_m"
        raise PolicyError(
            f"metadata {key!r} is {getattr(metadata, key):g}; the vessel's is {sees:g}"
        )


_TYPES = {field.name: field.type for field in msgspec.structs.fields(PolicyMetadata)}
_OPTIONAL = ("vessel", "perception_range_min_m")


def _check_inputs(text: str, objects: int) -> None:
    """Check the JSON description of the inputs: names, and units, frame and shape of each."""
    try:
        inputs: Any = json.loads(text)
    except ValueError as error:
        raise PolicyError(f"metadata 'inputs': not JSON: {error}") from error
    if not isinstance(inputs, dict):
        raise PolicyError("metadata 'inputs': expected an object of name -> units, frame, shape")
    if len(set(EXTENDED_INPUTS) & set(inputs)) == 1:
        raise PolicyError(f"metadata 'inputs': {' and '.join(EXTENDED_INPUTS)} come together")
    for name, shape in input_shapes(objects).items():
        if name not in inputs:
            if name in OPTIONAL_INPUTS:
                continue
            raise PolicyError(f"metadata 'inputs': {name!r} is missing")
        described = inputs[name]
        if not isinstance(described, dict) or not {"units", "frame", "shape"} <= set(described):
            raise PolicyError(f"metadata 'inputs.{name}': needs units, frame and shape")
        if described["shape"] != ["N", *shape]:
            raise PolicyError(
                f"metadata 'inputs.{name}.shape' is {described['shape']}; allowed: {['N', *shape]}"
            )
    reach_m = inputs.get(CONTOUR_INPUT, {}).get("range_m", CONTOUR_RANGE_M)
    if reach_m != CONTOUR_RANGE_M:
        raise PolicyError(
            f"metadata 'inputs.{CONTOUR_INPUT}.range_m' is {reach_m}; allowed: {CONTOUR_RANGE_M:g}"
        )

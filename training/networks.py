"""What the networks read, and what all of them are made of.

From raw observations (SI units, frame B) to features: fixed scales and the geometry of an
encounter, nothing learnt (`See`). From features to a code: `PaperEncoder` is the paper's (fig. 5);
`SetEncoder` is ours, the same answer in whatever order the objects come. Then what several
algorithms share: the trunk, the actor, the policy that is deployed. What one algorithm alone needs
is in its file.

Everything up to `Pilot` is part of the exported graph, so it uses only a few, plain tensor
operations, and it is finite for every finite input. Padding has no influence.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

import torch
from msgspec import Meta
from torch import Tensor, nn

from twinscrew.runtime.charts.contour import CONTOUR_RANGE_M, SECTORS
from twinscrew.runtime.messages.types import OBSERVED_OBJECTS
from twinscrew.runtime.policy.hull_units import describe_hull
from twinscrew.runtime.policy.vessel_model import VesselParameters
from twinscrew.runtime.settings import NonNegative, Positive, Settings
from twinscrew.runtime.vessel_description import load_vessel
from twinscrew.training.perception import (
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    OUTLINE_COLUMNS,
    layout_of,
)

ACTIONS = 2
"""[-] Left and right rate of change of thrust, in (-1, 1)."""
Width = Annotated[int, Meta(ge=8, le=2048)]


class Observations(NamedTuple):
    """A batch of B observations; the columns are those of `messages.types.Observation`."""

    ego: Tensor
    """(B, 7) float32: goal x, y [m]; surge, sway [m/s]; yaw rate [rad/s]; thrusts [N]. Eq. (2)."""
    objects: Tensor
    """(B, K, 5) float32: x, y [m]; vx, vy over ground [m/s]; radius [m]. Eq. (3)."""
    mask: Tensor
    """(B, K) float32: 1 where there is an object, 0 where there is padding."""
    outlines: Tensor
    """(B, K, 3) float32: half length, half beam [m], heading [rad]; zeros for a circle."""
    hull: Tensor
    """(B, 10) float32: the own hull, as `HULL_COLUMNS` says."""
    contour: Tensor
    """(B, 32) float32 [m]: the nearest edge in each sector (`runtime.charts.contour`)."""
    beyond: Tensor
    """(B, 1) float32 [m]: what is left of the way beyond the goal that is shown; for critics."""


def unpack(rows: Tensor) -> Observations:
    """Read rows, (..., W), as `perception.Observations` lays them out.

    Where they hold no outlines all objects are circles, and the hull is the default vessel.
    """
    layout = layout_of(rows.shape[-1])
    ego, objects, mask, *more = torch.split(rows, list(layout.widths), dim=-1)
    objects = objects.reshape(*mask.shape, OBJECT_COLUMNS)
    seen = circles(ego, objects, mask)
    if more:
        seen = seen._replace(outlines=more[0].reshape(*mask.shape, -1), hull=more[1])
    return seen._replace(contour=more[2], beyond=more[3]) if layout.contour else seen


def circles(ego: Tensor, objects: Tensor, mask: Tensor) -> Observations:
    """Give observations as the paper has them: circles, seen by the default vessel, no edges."""
    outlines = torch.zeros(*mask.shape, OUTLINE_COLUMNS, device=ego.device)
    hull = torch.tensor(DEFAULT_HULL, device=ego.device).expand(*ego.shape[:-1], -1)
    contour = torch.full((*ego.shape[:-1], SECTORS), CONTOUR_RANGE_M, device=ego.device)
    beyond = torch.zeros(*ego.shape[:-1], 1, device=ego.device)
    return Observations(ego, objects, mask, outlines, hull, contour, beyond)


DEFAULT_HULL = tuple(describe_hull(VesselParameters()).tolist())
"""What a policy is told of the default vessel."""


class Scales(Settings, frozen=True):
    """The numbers that bring raw SI units to about one."""

    length_m: Positive = 20.0
    """[m] The perception range (paper, sec. IV)."""
    speed_mps: Positive = 3.0
    """[m/s] About the greatest speed ahead (paper, sec. III)."""
    yaw_rate_radps: Positive = 0.7
    """[rad/s] About the steady yaw rate at full thrust difference in the training dynamics."""
    thrust_n: Positive = 1000.0
    """[N] The greatest thrust (paper, sec. III)."""
    gap_m: Positive = 5.0
    """[m] Where distances between hulls begin to matter: one vessel length."""
    time_s: Positive = 10.0
    """[s] Encounters further ahead than this are all alike: about the range at closing speed."""
    ego_radius_m: NonNegative = load_vessel().radius_m
    """[m] Collision radius of the default vessel, half its diagonal."""


EGO_FEATURES = 11
OBJECT_FEATURES = 14
_TINY = 1e-3  # [m, m/s] keeps directions and times finite at rest and at no distance


def raw_scales(scales: Scales) -> tuple[Tensor, Tensor]:
    """Give the factors, (7,) and (5,), that bring raw ego and object columns to about one."""
    length, speed = 1.0 / scales.length_m, 1.0 / scales.speed_mps
    thrust = 1.0 / scales.thrust_n
    ego = [length, length, speed, speed, 1.0 / scales.yaw_rate_radps, thrust, thrust]
    return torch.tensor(ego), torch.tensor([length, length, speed, speed, length])


def _length(vector: Tensor) -> Tensor:
    return torch.sqrt((vector * vector).sum(-1, keepdim=True) + _TINY**2)


def ego_features(ego: Tensor, scales: Scales) -> Tensor:
    """Give the scaled ego state with the goal's distance and direction.

    Parameters
    ----------
    ego : (B, 7)
        Raw ego states, frame B.

    Returns
    -------
    (B, 11)
        The scaled state; the goal's direction (2), its distance in units of `length_m`, and a
        closeness that resolves the last metres.
    """
    goal = ego[:, :2]
    distance = _length(goal)
    near = scales.gap_m / (scales.gap_m + distance)
    factors = raw_scales(scales)[0].to(ego)
    return torch.cat([ego * factors, goal / distance, distance / scales.length_m, near], dim=1)


class _Approach(NamedTuple):
    """How another object comes nearer if nobody alters course or speed; all (B, K, ...)."""

    direction: Tensor
    relative: Tensor
    """[m/s] Its velocity less the own one."""
    closing: Tensor
    time: Tensor
    """[s] Of the closest approach of the centres."""


def _approach(ego: Tensor, position: Tensor, velocity: Tensor, scales: Scales) -> _Approach:
    relative = velocity - ego[:, None, 2:4]
    distance = _length(position)
    direction = position / distance
    closing = -(direction * relative).sum(-1, keepdim=True)
    # Straight tracks p + v t are closest at t = -(p . v) / |v|^2.
    time = closing * distance / ((relative * relative).sum(-1, keepdim=True) + _TINY)
    return _Approach(direction, relative, closing, time.clamp(0.0, scales.time_s))


def object_features(ego: Tensor, objects: Tensor, scales: Scales) -> Tensor:
    """Give what matters in an encounter with each object.

    Parameters
    ----------
    ego : (B, 7)
        Raw ego states, frame B.
    objects : (B, K, 5)
        Raw object states, frame B; velocities over ground.

    Returns
    -------
    (B, K, 14)
        The scaled state (5); direction (2); relative velocity (2); gap between the hulls and its
        closeness; closing speed; time to, and gap at, the closest approach if neither turns.
    """
    position, velocity, radius = torch.split(objects, [2, 2, 1], dim=-1)
    direction, relative, closing, time = _approach(ego, position, velocity, scales)
    reach = radius + scales.ego_radius_m
    gap = _length(position) - reach
    miss = _length(position + relative * time) - reach
    factors = raw_scales(scales)[1].to(objects)
    return torch.cat(
        [
            objects * factors,
            direction,
            relative / scales.speed_mps,
            gap / scales.length_m,
            scales.gap_m / (scales.gap_m + gap.clamp(min=0.0)),
            closing / scales.speed_mps,
            time / scales.time_s,
            miss / scales.gap_m,
        ],
        dim=-1,
    )


HULL_SCALES = (3.0, 3.0, 3.0, 3.0, 0.7, 1.0, 1.0, 1.0, 0.5, 1000.0)
"""What brings a hull's description to about one."""
OUTLINED_FEATURES = 22


def hull_features(hull: Tensor) -> Tensor:
    """Give the scaled description of the own hull, (B, 10)."""
    return hull / torch.tensor(HULL_SCALES).to(hull)


def outlined_features(seen: Observations, scales: Scales) -> Tensor:
    """Give what matters in an encounter with each object, a rectangle or a circle, (B, K, 22).

    Gaps are those between the own circle and the other's outline, now and at the closest approach
    of straight tracks. Beside what `object_features` gives: the outline, and where the own vessel
    is, seen from the other along its course.
    """
    ego, objects, _, outlines, hull, *_ = seen
    position, velocity, radius = torch.split(objects, [2, 2, 1], dim=-1)
    half, heading = outlines[..., :2], outlines[..., 2:]
    rectangle = (half[..., :1] > 0.0).to(objects)
    cosine, sine = torch.cos(heading), torch.sin(heading)
    corner = radius * (1.0 - rectangle) + hull[:, None, :1]

    def gap_at(place: Tensor) -> Tensor:
        x, y = place[..., :1], place[..., 1:]
        along, across = cosine * x + sine * y, cosine * y - sine * x
        away = torch.cat([along, across], dim=-1).abs() - half
        return _length(away.clamp(min=0.0)) - corner

    direction, relative, closing, time = _approach(ego, position, velocity, scales)
    gap = gap_at(position)
    miss = gap_at(position + relative * time)
    speed = _length(velocity)
    course = velocity / (speed + 0.1)
    ahead = -(position * course).sum(-1, keepdim=True)
    port = position[..., :1] * course[..., 1:] - position[..., 1:] * course[..., :1]
    return torch.cat(
        [
            objects * raw_scales(scales)[1].to(objects),
            direction,
            relative / scales.speed_mps,
            gap / scales.length_m,
            scales.gap_m / (scales.gap_m + gap.clamp(min=0.0)),
            closing / scales.speed_mps,
            time / scales.time_s,
            1.0 / (1.0 + time),
            miss / scales.gap_m,
            half / scales.gap_m,
            cosine * rectangle,
            sine * rectangle,
            ahead / scales.length_m,
            port / scales.length_m,
            speed / scales.speed_mps,
        ],
        dim=-1,
    )


CONTOUR_FEATURES = 4 * SECTORS
CLOSE_M = 1.5
"""[m] Where a gap to an edge is narrow."""


def contour_features(seen: Observations, scales: Scales) -> tuple[Tensor, Tensor]:
    """Give what matters of the edges in each sector, (B, 4 * 32), and whether any is near, (B, 1).

    Gaps are those between the edge and the own hull, a rectangle of the default vessel's shape: how
    close they are, by two measures, the distance, and the speed towards them. All are zero in
    sectors without an edge, and the last number is: it rises to 1 as the nearest edge comes in.
    """
    distance = seen.contour
    angle = torch.arange(SECTORS, device=distance.device) * (2.0 * math.pi / SECTORS)
    cosine, sine = torch.cos(angle), torch.sin(angle)
    shape = VesselParameters()
    half_length, half_beam = shape.length / 2.0 / shape.radius, shape.width / 2.0 / shape.radius
    own = torch.minimum(half_length / (cosine.abs() + 1e-6), half_beam / (sine.abs() + 1e-6))
    gap = (distance - own * seen.hull[:, :1]).clamp(min=0.0)
    known = (distance < CONTOUR_RANGE_M).to(distance)
    towards = seen.ego[:, 2:3] * cosine + seen.ego[:, 3:4] * sine
    close = scales.gap_m / (scales.gap_m + gap)
    features = torch.cat(
        [
            close * known,
            CLOSE_M / (CLOSE_M + gap) * known,
            1.0 - distance / CONTOUR_RANGE_M,
            towards / scales.speed_mps * close * known,
        ],
        dim=1,
    )
    nearest = distance.amin(dim=1, keepdim=True)
    return features, (4.0 * (1.0 - nearest / CONTOUR_RANGE_M)).clamp(0.0, 1.0)


class EncoderSettings(Settings, frozen=True):
    """How observations become features."""

    kind: Literal["set", "paper", "outlined"] = "set"
    """"paper" is the paper's encoder; "set" pools one shared object network by maximum and sum;
    "outlined" is a set too, and knows the own hull and the objects' outlines."""
    normalise: bool = True
    """Scale raw SI units to about one first ("paper" only; "set" always does)."""
    ego_width: Width = 64
    """[-] Features of the ego state ("set" only; the paper's has 56)."""
    object_width: Width = 96
    """[-] Features of an object ("set" only; the paper's has 40)."""
    scales: Scales = Scales()
    """The units of the normalised features."""
    contour: bool = False
    """Read the edges of what is fixed too ("outlined" only)."""
    contour_width: Width = 96
    """[-] Features of the contour."""


class Seen(NamedTuple):
    """A batch of observations as features without parameters: the networks' input."""

    ego: Tensor
    """(B, E)"""
    objects: Tensor
    """(B, K, F); zeros where there is padding."""
    present: Tensor
    """(B, K, 1): 1 where there is an object."""
    contour: Tensor
    """(B, 128) Of the edges; (B, 0) where they are not read."""
    near: Tensor
    """(B, 1) In [0, 1]: 0 where no edge is known."""
    beyond: Tensor
    """(B, 2) Of the way beyond the goal that is shown: for critics alone."""


def with_risk(seen: Seen, risk: Tensor) -> Seen:
    """Give what is seen with a risk level, (B, 1) or (1, 1) in (0, 1], as one more ego feature."""
    return seen._replace(ego=torch.cat([seen.ego, risk.expand(seen.ego.shape[0], 1)], dim=1))


class See(nn.Module):
    """Turns observations into features; nothing here is learnt, so it is done once a batch."""

    ego_scale: Tensor
    object_scale: Tensor

    def __init__(self, settings: EncoderSettings) -> None:
        super().__init__()
        self.kind = settings.kind
        self.scales = settings.scales
        self.contour = settings.contour
        ones = torch.ones(EGO_COLUMNS), torch.ones(OBJECT_COLUMNS)
        ego, objects = raw_scales(settings.scales) if settings.normalise else ones
        self.register_buffer("ego_scale", ego, persistent=False)
        self.register_buffer("object_scale", objects, persistent=False)

    def forward(self, observations: Observations) -> Seen:
        """Give the features of a batch; whatever lies in padded rows has no influence."""
        ego, objects, mask, outlines, hull, distances, way = observations
        contour, near, beyond = distances[:, :0], way[:, :0], way[:, :0]
        if self.contour:
            contour, near = contour_features(observations, self.scales)
            beyond = torch.cat([way / 50.0, way / (way + self.scales.length_m)], dim=1)
        present = mask[:, :, None]
        objects = torch.where(present > 0, objects, 0.0)
        if self.kind == "outlined":
            outlines = torch.where(present > 0, outlines, 0.0)
            whole = observations._replace(objects=objects, outlines=outlines)
            objects = outlined_features(whole, self.scales)
            ego = torch.cat([ego_features(ego, self.scales), hull_features(hull)], dim=1)
        elif self.kind == "set":
            objects = object_features(ego, objects, self.scales)
            ego = ego_features(ego, self.scales)
        else:
            ego, objects = ego * self.ego_scale, objects * self.object_scale
        return Seen(ego, objects, present, contour, near, beyond)


class PaperEncoder(nn.Module):
    """Ego 7 -> 56, each object 5 -> 40 with shared weights, concatenated to 256 (paper, fig. 5)."""

    EGO, OBJECT = 56, 40

    def __init__(self, extra: int = 0) -> None:
        super().__init__()
        self.width = self.EGO + OBSERVED_OBJECTS * self.OBJECT
        self.ego = nn.Linear(EGO_COLUMNS + extra, self.EGO)
        self.object = nn.Linear(OBJECT_COLUMNS, self.OBJECT)

    def forward(self, seen: Seen) -> Tensor:
        """Give features (B, 256)."""
        theirs = torch.relu(self.object(seen.objects)) * seen.present
        return torch.cat([torch.relu(self.ego(seen.ego)), theirs.flatten(1)], dim=1)


class SetEncoder(nn.Module):
    """One network over every object, pooled by maximum and sum, beside the ego state's features."""

    def __init__(self, settings: EncoderSettings, extra: int = 0) -> None:
        super().__init__()
        wide, outlined = settings.object_width, settings.kind == "outlined"
        self.width = settings.ego_width + 2 * wide
        ego = EGO_FEATURES + extra + (len(HULL_SCALES) if outlined else 0)
        self.ego = nn.Linear(ego, settings.ego_width)
        self.object_seen = nn.Linear(OUTLINED_FEATURES if outlined else OBJECT_FEATURES, wide)
        self.object_ego = nn.Linear(ego, wide, bias=False)
        self.object_hidden = nn.Linear(wide, wide)
        self.contour: ContourEncoder | None = None
        if settings.contour:
            self.contour = ContourEncoder(ego, settings.contour_width, self.width)

    def forward(self, seen: Seen) -> Tensor:
        """Give features (B, ego width + 2 object width)."""
        # A layer over [object, ego] is the sum of two: the ego's share is the same for all objects.
        each = self.object_seen(seen.objects) + self.object_ego(seen.ego)[:, None, :]
        each = torch.relu(self.object_hidden(torch.relu(each))) * seen.present
        # After a ReLU nothing is below zero, so padding never is the maximum.
        code = torch.cat([torch.relu(self.ego(seen.ego)), each.amax(1), each.sum(1)], dim=1)
        return code if self.contour is None else code + self.contour(seen)


class ContourEncoder(nn.Module):
    """What the edges add to an encoder's features.

    Nothing where no edge is known, and nothing at all at first: what was learnt without edges, and
    is gone on from (`Agent.start_from`), stays as it is until it is learnt otherwise.
    """

    def __init__(self, ego: int, wide: int, out: int) -> None:
        super().__init__()
        self.seen = nn.Linear(CONTOUR_FEATURES, wide)
        self.ego = nn.Linear(ego, wide, bias=False)
        self.hidden = nn.Linear(wide, wide)
        self.out = nn.Linear(wide, out, bias=False)
        nn.init.zeros_(self.out.weight)

    def forward(self, seen: Seen) -> Tensor:
        """Give (B, out)."""
        code = torch.relu(self.seen(seen.contour) + self.ego(seen.ego))
        added: Tensor = self.out(torch.relu(self.hidden(code))) * seen.near
        return added


def make_encoder(settings: EncoderSettings, extra: int = 0) -> PaperEncoder | SetEncoder:
    """Build the encoder that the settings name, with `extra` more ego features (`with_risk`)."""
    return PaperEncoder(extra) if settings.kind == "paper" else SetEncoder(settings, extra)


class NetworkSettings(EncoderSettings, frozen=True):
    """The networks of an agent."""

    critic: Literal["joined", "paper"] = "joined"
    """"joined": action and state join before the quantile; "paper": action after it (fig. 5)."""
    feature_width: Width = 256
    """[-] Width of the layer that the quantile embedding multiplies (paper: 256)."""
    hidden_width: Width = 128
    """[-] Width of the hidden layers (paper: 128)."""
    cosines: Width = 64
    """[-] Cosine features of a quantile fraction (paper: 64)."""


def squash(value: Tensor) -> Tensor:
    """Map any number into (-1, 1): (2 / pi) atan, slower to saturate than tanh."""
    return torch.atan(value) * (2.0 / math.pi)


class Trunk(nn.Module):
    """Encoder -> 128 -> 128, ReLU."""

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        self.encoder = make_encoder(settings)
        self.width = settings.hidden_width
        self.hidden1 = nn.Linear(self.encoder.width, self.width)
        self.hidden2 = nn.Linear(self.width, self.width)

    def forward(self, seen: Seen) -> Tensor:
        """Give features (B, 128)."""
        return torch.relu(self.hidden2(torch.relu(self.hidden1(self.encoder(seen)))))


class Actor(nn.Module):
    """A deterministic policy: what is seen to actions in (-1, 1)."""

    def __init__(self, settings: NetworkSettings, extra: int = 0) -> None:
        super().__init__()
        self.encoder = make_encoder(settings, extra)
        hidden = settings.hidden_width
        self.hidden1 = nn.Linear(self.encoder.width, hidden)
        self.hidden2 = nn.Linear(hidden, hidden)
        self.output = nn.Linear(hidden, ACTIONS)

    def forward(self, seen: Seen) -> Tensor:
        """Give actions (B, 2)."""
        hidden = torch.relu(self.hidden1(self.encoder(seen)))
        hidden = torch.relu(self.hidden2(hidden))
        return squash(self.output(hidden))


class Beside(nn.Module):
    """Two actors: one acts where no edge is near, the other beside edges; between, a mixture.

    So what the first can do in open water stays, bit by bit, whatever the second has learnt.
    """

    def __init__(self, open_water: nn.Module, edges: nn.Module) -> None:
        super().__init__()
        self.open_water, self.edges = open_water, edges

    def forward(self, seen: Seen) -> Tensor:
        """Give actions (B, 2)."""
        action: Tensor = (1.0 - seen.near) * self.open_water(seen) + seen.near * self.edges(seen)
        return action


class Pilot(nn.Module):
    """A deterministic policy from raw observations: what is evaluated, deployed and exported."""

    factors: Tensor
    outline_factors: Tensor
    risk: Tensor | None

    def __init__(
        self, see: See, actor: nn.Module, radius_margin: float = 1.0, risk: float | None = None
    ) -> None:
        """Put a network behind its features.

        Parameters
        ----------
        see, actor
            Features without parameters, and the network over them.
        radius_margin
            [-] Multiplies every observed radius: perception sees a part of a hull, about 0.8 of
            its radius on average.
        risk
            [-] Level that holds where none is asked for, of a network conditioned on it.
        """
        super().__init__()
        self.see = see
        self.actor = actor
        factors = torch.tensor([1.0, 1.0, 1.0, 1.0, radius_margin], device=see.ego_scale.device)
        self.register_buffer("factors", factors, persistent=False)
        outline = torch.tensor([radius_margin, radius_margin, 1.0], device=factors.device)
        self.register_buffer("outline_factors", outline, persistent=False)
        level = None if risk is None else torch.full((1, 1), risk, device=factors.device)
        self.register_buffer("risk", level, persistent=False)

    def forward(self, observations: Observations, risk: Tensor | None = None) -> Tensor:
        """Give actions (B, 2) in [-1, 1], at risk levels, (B, 1) or (1, 1), if there are any."""
        wary = observations._replace(
            objects=observations.objects * self.factors,
            outlines=observations.outlines * self.outline_factors,
        )
        seen = self.see(wary)
        if self.risk is not None:
            seen = with_risk(seen, self.risk if risk is None else risk)
        action: Tensor = self.actor(seen)
        return action

"""How early ships on a collision course are announced, and how often others are.

    python -m tests.hil_sim.alarm_table [ENCOUNTERS] [SEED]

A boat sails at 2.5 m/s through waves that turn it by 6 degrees to either side. Ships of 15 to 80 m
report themselves by AIS as the simulator's transponders do (class A, 10 s, errors of 3 m that
wander, noise of 0.1 m/s, delays to 2 s, 5 % lost), keep course and speed, and pass at a miss
distance of up to 300 m to either side. Whether one is on a collision course is known: both go
straight. Tracks come of the boat's own `Ais`, `Tracker` and `Alarms` with default settings; there
is no LiDAR.
"""

import math
import sys
from dataclasses import dataclass

import numpy as np
from pyais import encode_dict

from twinscrew.runtime.datum import Datum, to_degrees
from twinscrew.runtime.geometry import quaternion_from_euler
from twinscrew.runtime.messages.marine import Sentence, encode_sentence
from twinscrew.runtime.messages.types import Objects, Odometry
from twinscrew.runtime.safety.alarms import Alarms
from twinscrew.runtime.senses.ais import SOURCE, Ais, AisSettings
from twinscrew.runtime.tracking.tracker import Tracker, TrackerSettings

DATUM = Datum(latitude_deg=63.44, longitude_deg=10.40)
EPOCH_NS = 1_735_689_600 * 10**9
OWN_MPS, MEETS_S, STEP_S = 2.5, 150.0, 0.5


@dataclass(frozen=True)
class Encounter:
    """One ship, and when it was announced."""

    speed_mps: float
    miss_m: float
    """[m] Between the surfaces, on true courses."""
    announced_s: float | None
    """[s] Before the closest approach; None: never."""


def encounter(rng: np.random.Generator) -> Encounter:
    """Let one ship pass."""
    speed, length = rng.uniform(3.0, 10.0), rng.uniform(15.0, 80.0)
    course, side = rng.uniform(-math.pi, math.pi), rng.uniform(-300.0, 300.0)
    own_v, v = np.array([OWN_MPS, 0.0]), speed * np.array([math.cos(course), math.sin(course)])
    relative = v - own_v
    if np.hypot(*relative) < 1.0:
        return encounter(rng)
    n = np.array([-relative[1], relative[0]]) / np.hypot(*relative)
    start = own_v * MEETS_S + side * n - v * MEETS_S  # nearest at MEETS_S, `side` off
    radius = 0.5 * math.hypot(length, 0.25 * length)
    ais, alarms = Ais(AisSettings(datum=DATUM)), Alarms()
    tracker = Tracker(TrackerSettings(sources={"ais": SOURCE}))
    error, next_s, heard, announced = rng.normal(0.0, 3.0, 2), rng.uniform(0.0, 10.0), [], None
    for k in range(round((MEETS_S + 20.0) / STEP_S)):
        t = k * STEP_S
        stamp_ns = EPOCH_NS + round(t * 1e9)
        here = own(t, stamp_ns, rng)
        if t >= next_s:
            keep = math.exp(-10.0 / 60.0)
            error = keep * error + math.sqrt(1 - keep**2) * rng.normal(0.0, 3.0, 2)
            if rng.random() > 0.05:
                texts = report(t, start + v * t + error, v + rng.normal(0, 0.1, 2), length)
                heard += [(t + rng.uniform(0.1, 2.0), text) for text in texts]
            next_s = t + 10.0 * rng.uniform(0.9, 1.1)
        for due, text in [each for each in heard if each[0] <= t]:
            heard.remove((due, text))
            payload = encode_sentence(Sentence(stamp_ns=stamp_ns, text=text))
            for look in ais.take(payload, stamp_ns, lambda _ns, here=here: here).looks:
                tracker.take(look)
        tracks = tracker.step(nothing(stamp_ns), here)
        names = [event.name for event in alarms.step(here, tracks)]
        if announced is None and "collision_course" in names:
            announced = MEETS_S - t
    return Encounter(speed, abs(side) - radius - alarms.settings.own_radius_m, announced)


def own(t: float, stamp_ns: int, rng: np.random.Generator) -> Odometry:
    """The boat goes north; waves turn it, and push it about."""
    heading = math.radians(6.0) * math.sin(2.0 * t) + rng.normal(0.0, 0.01)
    v_N = np.array([OWN_MPS, 0.0]) + rng.normal(0.0, 0.2, 2)
    c, s = math.cos(heading), math.sin(heading)
    return Odometry(
        stamp_ns=stamp_ns,
        position_N=np.array([OWN_MPS * t, 0.0, 0.0]),
        q_NB=quaternion_from_euler(0.0, 0.0, heading),
        velocity_B=np.array([c * v_N[0] + s * v_N[1], c * v_N[1] - s * v_N[0], 0.0]),
        rates_B=np.zeros(3),
    )


def report(t: float, p_N: np.ndarray, v_N: np.ndarray, length: float) -> list[str]:
    latitude, longitude = to_degrees(DATUM, p_N)
    speed, course = math.hypot(*v_N), math.degrees(math.atan2(v_N[1], v_N[0])) % 360.0
    position = {
        "type": 1,
        "mmsi": 257000001,
        "lat": latitude,
        "lon": longitude,
        "speed": speed * 3600.0 / 1852.0,
        "course": min(course, 359.9),
        "heading": round(course) % 360,
        "second": int(t) % 60,
        "accuracy": 1,
    }
    beam = round(length / 8)
    size = {"to_bow": round(length / 2), "to_stern": round(length / 2)}
    static = {"type": 5, "mmsi": 257000001, "to_port": beam, "to_starboard": beam, **size}
    return [
        text
        for fields in (static, position)
        for text in encode_dict(fields, talker_id="AI", sentence_type="VDM")
    ]


def nothing(stamp_ns: int) -> Objects:
    return Objects(
        stamp_ns=stamp_ns,
        p_L=np.empty((0, 2)),
        radius=np.empty(0),
        points=np.empty(0, np.int64),
    )


def main(count: int = 300, seed: int = 0) -> None:
    """Print the table."""
    rng = np.random.default_rng(seed)
    found = [encounter(rng) for _ in range(count)]
    limit = Alarms().settings.cpa_m
    print(f"{count} ships, seed {seed}; limit {limit:g} m")
    for low, high in ((-1e9, 0.0), (0.0, limit), (limit, 30.0), (30.0, 60.0), (60.0, 1e9)):
        rows = [each for each in found if low <= each.miss_m < high]
        ahead = [each.announced_s for each in rows if each.announced_s is not None]
        early = sum(each >= 60.0 for each in ahead)
        median = f"{np.median(ahead):.0f} s" if ahead else "-"
        print(
            f"miss {max(low, -99):6.0f} to {min(high, 999):4.0f} m: {len(rows):4d} ships, "
            f"announced {len(ahead):4d}, 60 s ahead {early:4d}, median {median}"
        )


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))

// Where COLREGs apply around a vessel that moves, as the runtime checks them.

import { offset, polygon } from "./pen.js";
import { colours } from "./theme.js";

const HEAD_ON = 1; // runtime.policy.colregs.Situation
const GIVE_WAY = 2;

// The zones around what moves; of a vessel that is not followed, only those that ask something.
export function drawZones(pen, camera, { tracks }, zones, all) {
  const alpha = pen.globalAlpha;
  for (const { north, east, vNorth, vEast, situation } of tracks) {
    if (Math.hypot(vNorth, vEast) < zones.min_speed_mps || !(all || situation)) continue;
    const course = Math.atan2(vEast, vNorth);
    const place = ([ahead, starboard]) => offset(camera, north, east, course, ahead, starboard);
    for (const [rule, outline] of [[HEAD_ON, headOnZone(zones)], [GIVE_WAY, crossingZone(zones)]]) {
      const asks = situation === rule;
      if (!asks && !all) continue;
      polygon(pen, outline.map(place));
      pen.fillStyle = pen.strokeStyle = asks ? colours.danger : colours.caution;
      pen.globalAlpha = alpha * (asks ? 0.16 : 0.05);
      pen.fill();
      pen.globalAlpha = alpha * (asks ? 0.8 : 0.3);
      pen.lineWidth = 1;
      pen.stroke();
    }
  }
  pen.globalAlpha = alpha;
}

// Corners [m]: along the other's velocity, to its starboard (runtime/policy/colregs.py).
export function headOnZone({ head_on_ahead_m: ahead, head_on_half_width_m: half }) {
  return [[0, -half], [ahead, -half], [ahead, half], [0, half]];
}

export function crossingZone({ crossing_ahead_m: ahead, crossing_astern_m: astern, crossing_port_m: port, crossing_corner_m: corner }) {
  return [[-astern, 0], [0, 0], [ahead, -corner], [ahead, -port], [-astern, -port]];
}

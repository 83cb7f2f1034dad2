// A catamaran seen from above: two floats, a deck between them, its name beside it.

import { offset, polygon, text } from "./pen.js";
import { colours } from "./theme.js";

const SMALL_PX_PER_M = 3; // below this a pointed outline says more than two floats
const FLOAT_WIDTH = 0.3; // of the half beam
const COURSE_S = 3; // the way over ground of this long is drawn

export function drawVessel(pen, camera, vessel, hull, colour) {
  if (!vessel.pose) return;
  const [north, east, heading] = vessel.pose;
  const place = (ahead, starboard) => offset(camera, north, east, heading, ahead, starboard);
  pen.globalAlpha = vessel.silent_s > 1 ? 0.4 : 1;
  drawCourse(pen, camera, vessel, colour);
  pen.fillStyle = colour;
  pen.strokeStyle = colours.card;
  pen.lineWidth = 1;
  const outlines = camera.scale < SMALL_PX_PER_M ? [pointed(hull)] : [...floats(hull), deck(hull)];
  for (const outline of outlines) {
    polygon(pen, outline.map(([ahead, starboard]) => place(ahead, starboard)));
    pen.fill();
    pen.stroke();
  }
  const [x, y] = [camera.x(east), camera.y(north)];
  pen.fillStyle = colours.ink;
  text(pen, vessel.name, x + 10 + hull.half_width_m * camera.scale, y - 8 - hull.half_width_m * camera.scale);
  pen.globalAlpha = 1;
}

function drawCourse(pen, camera, { pose, velocity }, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(camera.x(pose[1]), camera.y(pose[0]));
  pen.lineTo(camera.x(pose[1] + COURSE_S * velocity[1]), camera.y(pose[0] + COURSE_S * velocity[0]));
  pen.stroke();
}

function floats({ aft_m: aft, fore_m: fore, half_width_m: half }) {
  const inner = half * (1 - 2 * FLOAT_WIDTH);
  const middle = half * (1 - FLOAT_WIDTH);
  const shoulder = fore - 0.28 * (fore - aft);
  return [-1, 1].map((side) =>
    [[aft, inner], [shoulder, inner], [fore, middle], [shoulder, half], [aft, half]].map(([a, s]) => [a, side * s]),
  );
}

function deck({ aft_m: aft, fore_m: fore, half_width_m: half }) {
  const middle = (aft + fore) / 2;
  const reach = 0.22 * (fore - aft);
  const width = 0.62 * half;
  return [[middle - reach, -width], [middle + reach, -width], [middle + reach, width], [middle - reach, width]];
}

function pointed({ aft_m: aft, fore_m: fore, half_width_m: half }) {
  return [[fore, 0], [aft, half], [aft * 0.6, 0], [aft, -half]];
}

// Everything that is drawn on the chart, from the water up, and the colours for it.
// Places are in metres north and east; `pen` is a canvas context in CSS pixels.

import { compass, courseOf, distance, isSilent } from "./model.js";

const NAMES = ["ink", "faint", "card", "water", "grid", "shore", "quay", "shallow", "buoy", "danger", "caution", "fine", "zone"];
const VESSELS = 8; // as many colours
const GRID_STEPS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const GRID_PX = 64;
const FLOW_S = 4; // arrows of the current are as long as it flows in this time
const AHEAD_S = 3; // velocities are drawn as the way of this long
const ECHO_PX = 1.5;
const SMALL_PX_PER_M = 3; // below this a pointed outline says more than two floats
const FLOAT_WIDTH = 0.3; // of the half beam
const NARROW_PX = 600; // labels on a narrower chart are narrower, too
const RULES = { 1: [14, "meets", "head-on"], 2: [15, "gives way to", ""] }; // runtime.policy.colregs.Situation

export const colours = { vessels: [] };

// Reads the style sheet's colours, again whenever the system turns dark or light.
export function watchTheme(changed) {
  const read = () => {
    const style = getComputedStyle(document.documentElement);
    for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
    colours.vessels = Array.from({ length: VESSELS }, (_, i) => style.getPropertyValue(`--v${i}`).trim());
    changed();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", read);
  read();
}

export function vesselColour(index) {
  return colours.vessels[index % VESSELS];
}

// ------------------------------------------------------------------------------------ the sea

export function drawGrid(pen, camera) {
  const step = gridStep(camera);
  const halfWidth = camera.width / 2 / camera.scale;
  const halfHeight = camera.height / 2 / camera.scale;
  pen.strokeStyle = colours.grid;
  pen.lineWidth = 1;
  pen.beginPath();
  for (let east = ceilTo(camera.east - halfWidth, step); east < camera.east + halfWidth; east += step) {
    const x = Math.round(camera.x(east)) + 0.5;
    pen.moveTo(x, 0);
    pen.lineTo(x, camera.height);
  }
  for (let north = ceilTo(camera.north - halfHeight, step); north < camera.north + halfHeight; north += step) {
    const y = Math.round(camera.y(north)) + 0.5;
    pen.moveTo(0, y);
    pen.lineTo(camera.width, y);
  }
  pen.stroke();
}

export function drawScene(pen, camera, scene) {
  if (scene.map_size_m) {
    const [north, east] = scene.map_size_m;
    pen.strokeStyle = colours.shore;
    pen.setLineDash([6, 5]);
    pen.lineWidth = 1;
    pen.strokeRect(camera.x(0), camera.y(north), east * camera.scale, north * camera.scale);
    pen.setLineDash([]);
  }
  for (const region of scene.regions) drawRegion(pen, camera, region);
  drawFlow(pen, camera, scene.flow);
  for (const [north, east, length, width, , heading] of scene.quays) {
    polygon(pen, rectangle(camera, north, east, heading, length / 2, width / 2));
    pen.fillStyle = colours.quay;
    pen.fill();
  }
}

// Land is filled, water that is too shallow too; what is closed by rule is hatched, a fence to stay
// within is a dashed line.
export function drawRegion(pen, camera, { kind, ring, holes, keep_in: keepIn }) {
  pen.beginPath();
  for (const corners of [ring, ...holes]) {
    corners.forEach(([north, east], i) => {
      const [x, y] = [camera.x(east), camera.y(north)];
      if (i) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    });
    pen.closePath();
  }
  pen.save();
  if (kind === "land" || kind === "depth" || kind === "hazard") {
    pen.fillStyle = { land: colours.quay, depth: colours.shallow, hazard: colours.faint }[kind];
    pen.fill("evenodd");
    pen.strokeStyle = colours.shore;
    pen.lineWidth = 1;
  } else {
    pen.strokeStyle = colours.zone;
    pen.lineWidth = keepIn ? 1.8 : 1;
    if (keepIn) pen.setLineDash([8, 5]);
  }
  pen.stroke();
  if (!keepIn && (kind === "keep_out" || kind === "fence")) {
    pen.clip("evenodd");
    pen.globalAlpha *= 0.5;
    slant(pen, 0, camera.width, 0, camera.height);
  }
  pen.restore();
}

// Arrows of a current that is not the same everywhere, as long as it flows in `FLOW_S`.
function drawFlow(pen, camera, flow) {
  pen.fillStyle = pen.strokeStyle = colours.shore;
  pen.lineWidth = 1.2;
  for (const [north, east, vNorth, vEast] of flow) {
    if (Math.hypot(vNorth, vEast) < 0.02) continue;
    const [x, y] = [camera.x(east), camera.y(north)];
    const to = [camera.x(east + FLOW_S * vEast), camera.y(north + FLOW_S * vNorth)];
    arrow(pen, x, y, ...to);
  }
}

export function drawBuoys(pen, camera, scene) {
  for (const [north, east, radius] of scene.piles) {
    pen.fillStyle = colours.ink;
    circle(pen, camera, north, east, radius, 2);
    pen.fill();
  }
  for (const [north, east, radius] of scene.buoys) {
    pen.fillStyle = colours.buoy;
    circle(pen, camera, north, east, radius, 4);
    pen.fill();
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 1;
    pen.stroke();
  }
}

export function drawScaleBar(pen, camera) {
  const step = gridStep(camera);
  const [x, y, width] = [16, camera.height - 14, step * camera.scale];
  pen.strokeStyle = colours.faint;
  pen.fillStyle = colours.faint;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(x, y - 5);
  pen.lineTo(x, y);
  pen.lineTo(x + width, y);
  pen.lineTo(x + width, y - 5);
  pen.stroke();
  write(pen, `${step} m`, x + width / 2, y - 7, "center");
}

// North, and above the scale bar wind and current, where they are known.
export function drawCompass(pen, camera, { wind, current }) {
  const x = camera.width - 24;
  pen.fillStyle = pen.strokeStyle = colours.faint;
  write(pen, "N", x, 42, "center");
  polygon(pen, [[x, 12], [x - 5, 27], [x, 24], [x + 5, 27]]);
  pen.fill();
  let y = camera.height - 46;
  const flow = (words, towards) => {
    const [dx, dy] = [9 * Math.sin(towards), -9 * Math.cos(towards)];
    arrow(pen, 26 - dx, y - 4 - dy, 26 + dx, y - 4 + dy);
    write(pen, words, 42, y);
    y -= 20;
  };
  if (current && Math.hypot(...current) > 0) {
    const towards = Math.atan2(current[1], current[0]);
    flow(`current ${Math.hypot(...current).toFixed(1)} m/s to ${compass(towards)}`, towards);
  }
  if (wind && wind[0] > 0) {
    const from = (wind[1] * Math.PI) / 180;
    flow(`wind ${wind[0].toFixed(1)} m/s from ${compass(from)}`, from + Math.PI);
  }
}

// -------------------------------------------------------------------------------- the vessels

export function drawTrail(pen, camera, places, colour) {
  if (places.length < 2) return;
  pen.strokeStyle = colour;
  pen.lineWidth = 1.6;
  pen.lineJoin = "round";
  const alpha = pen.globalAlpha;
  pen.globalAlpha = 0.55 * alpha;
  pen.beginPath();
  for (const [, north, east] of places) pen.lineTo(camera.x(east), camera.y(north));
  pen.stroke();
  pen.globalAlpha = alpha;
}

// The way that the vessel means to go, around what is fixed.
export function drawRoute(pen, camera, { route, ended }, colour) {
  if (!route || route.length < 2 || ended) return;
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = 1.4;
  pen.setLineDash([7, 4]);
  pen.beginPath();
  for (const [north, east] of route) pen.lineTo(camera.x(east), camera.y(north));
  pen.stroke();
  pen.setLineDash([]);
  for (const [north, east] of route.slice(1, -1)) {
    pen.beginPath();
    pen.arc(camera.x(east), camera.y(north), 2.5, 0, 2 * Math.PI);
    pen.fill();
  }
}

export function drawGoal(pen, camera, { goal, pose, ended }, radius, colour) {
  if (!goal) return;
  const [x, y] = [camera.x(goal[1]), camera.y(goal[0])];
  pen.strokeStyle = colour;
  pen.fillStyle = colour;
  pen.lineWidth = 1.5;
  circle(pen, camera, goal[0], goal[1], radius, 6);
  pen.stroke();
  pen.beginPath();
  pen.arc(x, y, 2.5, 0, 2 * Math.PI);
  pen.fill();
  if (!pose || ended) return;
  pen.lineWidth = 1;
  pen.setLineDash([2, 6]);
  line(pen, camera.x(pose[1]), camera.y(pose[0]), x, y);
  pen.setLineDash([]);
}

// A catamaran seen from above, two floats and a deck between them, and its way over ground.
export function drawVessel(pen, camera, vessel, hull, colour) {
  if (!vessel.pose) return;
  const [north, east, heading] = vessel.pose;
  const place = (ahead, starboard) => offset(camera, north, east, heading, ahead, starboard);
  pen.globalAlpha = isSilent(vessel) ? 0.4 : 1;
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  const { velocity } = vessel;
  line(pen, camera.x(east), camera.y(north), camera.x(east + AHEAD_S * velocity[1]), camera.y(north + AHEAD_S * velocity[0]));
  pen.fillStyle = colour;
  pen.strokeStyle = colours.card;
  pen.lineWidth = 1;
  const outlines = camera.scale < SMALL_PX_PER_M ? [pointed(hull)] : [...floats(hull), deck(hull)];
  for (const outline of outlines) {
    polygon(pen, outline.map(([ahead, starboard]) => place(ahead, starboard)));
    pen.fill();
    pen.stroke();
  }
  pen.globalAlpha = 1;
}

export function labelVessel(labels, camera, vessel, colour) {
  const { name, pose, velocity, goal, ended } = vessel;
  if (!pose) return;
  const lines = [name];
  if (ended) lines.push({ goal: "arrived", collision: "collided", timeout: "out of time" }[ended.outcome] ?? ended.outcome);
  else if (isSilent(vessel)) lines.push(`silent for ${vessel.silent_s.toFixed(0)} s`);
  else {
    const toGoal = vessel.arrived ? "arrived" : goal ? `${distance(pose, goal).toFixed(0)} m to goal` : "";
    const words = [`${Math.hypot(...velocity).toFixed(1)} m/s ${compass(courseOf(vessel))}`, toGoal].filter(Boolean);
    lines.push(...(camera.width < NARROW_PX ? words : [words.join(" \u00b7 ")]));
  }
  labels.put(camera.x(pose[1]), camera.y(pose[0]), 2.4 * camera.scale + 4, lines, colour);
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

// ------------------------------------------------------------------------------ what they see

export function drawEchoes(pen, camera, { pose, echoes }, colour) {
  if (!pose) return;
  const [x0, y0] = [camera.x(pose[1]), camera.y(pose[0])];
  const pixels = camera.scale / 100;
  pen.fillStyle = colour;
  for (let i = 0; i < echoes.length; i += 2) {
    pen.fillRect(x0 + pixels * echoes[i + 1], y0 - pixels * echoes[i], ECHO_PX, ECHO_PX);
  }
}

export function drawObjects(pen, camera, { objects }, colour) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.setLineDash([3, 3]);
  for (const [north, east, radius] of objects) {
    circle(pen, camera, north, east, radius, 3);
    pen.stroke();
  }
  pen.setLineDash([]);
}

export function drawTracks(pen, camera, { tracks }, colour, detailed) {
  const alpha = pen.globalAlpha;
  pen.strokeStyle = colour;
  pen.fillStyle = colour;
  pen.lineWidth = detailed ? 1.5 : 1;
  for (const { north, east, vNorth, vEast, radius, unseen } of tracks) {
    pen.globalAlpha = alpha * (unseen > 0 || !detailed ? 0.5 : 1);
    circle(pen, camera, north, east, radius, 4);
    pen.stroke();
    if (!detailed) continue;
    const [x, y] = [camera.x(east), camera.y(north)];
    arrow(pen, x, y, x + AHEAD_S * vEast * camera.scale, y - AHEAD_S * vNorth * camera.scale);
  }
  pen.globalAlpha = alpha;
}

// A pair that comes too near: a line between them, and where they will be when they are nearest.
export function drawAlarm(pen, camera, { vessel, track }) {
  const { pose, velocity } = vessel;
  pen.strokeStyle = colours.danger;
  pen.lineWidth = 2;
  pen.setLineDash([7, 5]);
  line(pen, camera.x(pose[1]), camera.y(pose[0]), camera.x(track.east), camera.y(track.north));
  pen.setLineDash([]);
  const then = [
    [pose[0] + velocity[0] * track.tcpa, pose[1] + velocity[1] * track.tcpa],
    [track.north + track.vNorth * track.tcpa, track.east + track.vEast * track.tcpa],
  ];
  for (const [north, east] of then) {
    const [x, y] = [camera.x(east), camera.y(north)];
    line(pen, x - 5, y - 5, x + 5, y + 5);
    line(pen, x - 5, y + 5, x + 5, y - 5);
  }
}

export function drawTarget(pen, camera, [north, east]) {
  const [x, y] = [camera.x(east), camera.y(north)];
  pen.strokeStyle = colours.danger;
  pen.lineWidth = 2;
  for (const radius of [6, 12]) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.stroke();
  }
}

// Where COLREGs apply around a vessel that moves, as the runtime checks them. Of a vessel that is
// not followed, only those that ask something; those name the rule and the two.
export function drawZones(pen, camera, names, { name, tracks }, zones, all) {
  const alpha = pen.globalAlpha;
  for (const track of tracks) {
    const { north, east, vNorth, vEast, situation } = track;
    if (Math.hypot(vNorth, vEast) < zones.min_speed_mps || !(all || situation)) continue;
    const course = Math.atan2(vEast, vNorth);
    for (const [kind, outline] of [[1, headOnZone(zones)], [2, crossingZone(zones)]]) {
      const asks = situation === kind;
      if (!asks && !all) continue;
      const corners = outline.map(([ahead, starboard]) => offset(camera, north, east, course, ahead, starboard));
      pen.strokeStyle = colours.zone;
      pen.globalAlpha = alpha * (asks ? 0.35 : 0.12);
      hatch(pen, corners);
      pen.globalAlpha = alpha * (asks ? 0.9 : 0.35);
      pen.lineWidth = asks ? 1.5 : 1;
      pen.setLineDash(asks ? [] : [5, 5]);
      polygon(pen, corners);
      pen.stroke();
      pen.setLineDash([]);
      pen.globalAlpha = alpha;
      if (!asks) continue;
      const [x, y] = [0, 1].map((axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
      names.push([x, y, 6, [zoneWords(name, track)], colours.zone]);
    }
  }
}

export function zoneWords(name, { id, situation, name: other }) {
  const [rule, verb, how] = RULES[situation];
  return `rule ${rule}: ${name} ${verb} ${other || `track ${id}`} ${how}`.trim();
}

// Corners [m]: along the other's velocity, to its starboard (runtime/policy/colregs.py).
export function headOnZone({ head_on_ahead_m: ahead, head_on_half_width_m: half }) {
  return [[0, -half], [ahead, -half], [ahead, half], [0, half]];
}

export function crossingZone({ crossing_ahead_m: ahead, crossing_astern_m: astern, crossing_port_m: port, crossing_corner_m: corner }) {
  return [[-astern, 0], [0, 0], [ahead, -corner], [ahead, -port], [-astern, -port]];
}

// -------------------------------------------------------------------------------------- shapes

function hatch(pen, corners) {
  const [xs, ys] = [0, 1].map((axis) => corners.map((corner) => corner[axis]));
  const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  pen.save();
  polygon(pen, corners);
  pen.clip();
  slant(pen, left, right, top, bottom);
  pen.restore();
}

const HATCH_PX = 9;

// Slanting lines over a part of the view; who calls it has clipped.
function slant(pen, left, right, top, bottom) {
  pen.lineWidth = 1;
  pen.beginPath();
  for (let x = left - (bottom - top); x < right; x += HATCH_PX) {
    pen.moveTo(x, bottom);
    pen.lineTo(x + bottom - top, top);
  }
  pen.stroke();
}

// A place ahead and to starboard [m] of another one, in pixels.
function offset(camera, north, east, heading, ahead, starboard) {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  return [camera.x(east + s * ahead + c * starboard), camera.y(north + c * ahead - s * starboard)];
}

function rectangle(camera, north, east, heading, halfLength, halfWidth) {
  const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]];
  return corners.map(([a, b]) => offset(camera, north, east, heading, a * halfLength, b * halfWidth));
}

function polygon(pen, corners) {
  pen.beginPath();
  for (const [x, y] of corners) pen.lineTo(x, y);
  pen.closePath();
}

function circle(pen, camera, north, east, radius, leastPx) {
  pen.beginPath();
  pen.arc(camera.x(east), camera.y(north), Math.max(radius * camera.scale, leastPx), 0, 2 * Math.PI);
}

export function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

function arrow(pen, x0, y0, x1, y1) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < 6) return;
  line(pen, x0, y0, x1, y1);
  const [dx, dy] = [(x1 - x0) / length, (y1 - y0) / length];
  polygon(pen, [[x1, y1], [x1 - 7 * dx + 3 * dy, y1 - 7 * dy - 3 * dx], [x1 - 7 * dx - 3 * dy, y1 - 7 * dy + 3 * dx]]);
  pen.fill();
}

// Writes words with a halo of water around them: they may lie on anything.
export function write(pen, words, x, y, align = "left", bold = false) {
  pen.font = font(bold);
  pen.textAlign = align;
  pen.save();
  pen.setLineDash([]);
  pen.strokeStyle = colours.water;
  pen.lineWidth = 3;
  pen.lineJoin = "round";
  pen.strokeText(words, x, y);
  pen.restore();
  pen.fillText(words, x, y);
}

export function measureWords(pen, words, bold) {
  pen.font = font(bold);
  return pen.measureText(words).width;
}

function font(bold) {
  return `${bold ? "600 " : ""}12px system-ui, 'DejaVu Sans', sans-serif`;
}

function gridStep(camera) {
  return GRID_STEPS_M.find((step) => step * camera.scale >= GRID_PX) ?? GRID_STEPS_M.at(-1);
}

function ceilTo(value, step) {
  return Math.ceil(value / step) * step;
}

// The chart's layers. Places in metres north and east; `pen` is a canvas context in CSS pixels.

import { colours } from "./theme.js";

const GRID_STEPS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const GRID_PX = 64;
const AHEAD_S = 3; // velocities are drawn as the way of this long
const ECHO_PX = 1.5;
const HEAD_ON = 1; // runtime.policy.colregs.Situation

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

export function drawScaleBar(pen, camera) {
  const step = gridStep(camera);
  const [x, y, width] = [16, camera.height - 16, step * camera.scale];
  pen.strokeStyle = colours.faint;
  pen.fillStyle = colours.faint;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(x, y - 5);
  pen.lineTo(x, y);
  pen.lineTo(x + width, y);
  pen.lineTo(x + width, y - 5);
  pen.stroke();
  text(pen, `${step} m`, x + width / 2, y - 7, "center");
  text(pen, "N", camera.width - 22, 40, "center");
  pen.beginPath();
  pen.moveTo(camera.width - 22, 12);
  pen.lineTo(camera.width - 27, 26);
  pen.lineTo(camera.width - 22, 23);
  pen.lineTo(camera.width - 17, 26);
  pen.fill();
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
  for (const [north, east, length, width, , heading] of scene.quays) {
    polygon(pen, rectangle(camera, north, east, heading, length / 2, width / 2));
    pen.fillStyle = colours.quay;
    pen.fill();
  }
}

export function drawBuoys(pen, camera, scene) {
  for (const [north, east, radius] of scene.buoys) {
    pen.fillStyle = colours.buoy;
    circle(pen, camera, north, east, radius, 4);
    pen.fill();
    pen.strokeStyle = colours.card;
    pen.lineWidth = 1.5;
    pen.stroke();
  }
}

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

export function drawGoal(pen, camera, { goal, pose }, radius, colour) {
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
  if (!pose) return;
  pen.lineWidth = 1;
  pen.setLineDash([2, 6]);
  line(pen, camera.x(pose[1]), camera.y(pose[0]), x, y);
  pen.setLineDash([]);
}

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

// The zones around what moves; of a vessel that is not followed, only those that ask something.
export function drawZones(pen, camera, { tracks }, zones, all) {
  const alpha = pen.globalAlpha;
  for (const { north, east, vNorth, vEast, situation } of tracks) {
    if (Math.hypot(vNorth, vEast) < zones.min_speed_mps || !(all || situation)) continue;
    const course = Math.atan2(vEast, vNorth);
    const place = ([ahead, starboard]) => offset(camera, north, east, course, ahead, starboard);
    for (const [rule, outline] of [[HEAD_ON, headOnZone(zones)], [HEAD_ON + 1, crossingZone(zones)]]) {
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

function headOnZone({ head_on_ahead_m: ahead, head_on_half_width_m: half }) {
  return [[0, -half], [ahead, -half], [ahead, half], [0, half]];
}

function crossingZone({ crossing_ahead_m: ahead, crossing_astern_m: astern, crossing_port_m: port, crossing_corner_m: corner }) {
  return [[-astern, 0], [0, 0], [ahead, -corner], [ahead, -port], [-astern, -port]];
}

// A place ahead and to starboard [m] of another one, in pixels.
export function offset(camera, north, east, heading, ahead, starboard) {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  return [camera.x(east + s * ahead + c * starboard), camera.y(north + c * ahead - s * starboard)];
}

export function polygon(pen, corners) {
  pen.beginPath();
  for (const [x, y] of corners) pen.lineTo(x, y);
  pen.closePath();
}

export function text(pen, words, x, y, align = "left") {
  pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  pen.textAlign = align;
  pen.fillText(words, x, y);
}

function rectangle(camera, north, east, heading, halfLength, halfWidth) {
  const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]];
  return corners.map(([a, b]) => offset(camera, north, east, heading, a * halfLength, b * halfWidth));
}

function circle(pen, camera, north, east, radius, leastPx) {
  pen.beginPath();
  pen.arc(camera.x(east), camera.y(north), Math.max(radius * camera.scale, leastPx), 0, 2 * Math.PI);
}

function line(pen, x0, y0, x1, y1) {
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

function gridStep(camera) {
  return GRID_STEPS_M.find((step) => step * camera.scale >= GRID_PX) ?? GRID_STEPS_M.at(-1);
}

function ceilTo(value, step) {
  return Math.ceil(value / step) * step;
}

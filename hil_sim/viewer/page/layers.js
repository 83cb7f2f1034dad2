// The chart's layers. Places in metres north and east; `pen` is a canvas context in CSS pixels.

import { arrow, circle, line, polygon, rectangle, text } from "./pen.js";
import { colours } from "./theme.js";

const GRID_STEPS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const GRID_PX = 64;
const AHEAD_S = 3; // velocities are drawn as the way of this long
const ECHO_PX = 1.5;

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

function gridStep(camera) {
  return GRID_STEPS_M.find((step) => step * camera.scale >= GRID_PX) ?? GRID_STEPS_M.at(-1);
}

function ceilTo(value, step) {
  return Math.ceil(value / step) * step;
}

// The chart: where one looks, what is drawn of whom and in which order, and where labels find room.

import {
  colours,
  drawAlarm,
  drawBuoys,
  drawCompass,
  drawEchoes,
  drawGoal,
  drawGrid,
  drawObjects,
  drawRegion,
  drawRoute,
  drawScaleBar,
  drawScene,
  drawTarget,
  drawTracks,
  drawTrail,
  drawVessel,
  drawZones,
  labelVessel,
  line,
  measureWords,
  vesselColour,
  write,
} from "./draw.js";
import { bearing, compass, distance } from "./model.js";

const SMALLEST = 0.2; // [px/m]
const LARGEST = 80;
const FEW = 3; // so many vessels' details can be told apart
const PALE = 0.3;
const LINE_PX = 15; // between two lines of a label

// Where one looks: a centre [m, north and east] and a scale [px/m]. North is up.
export class Camera {
  constructor() {
    this.north = 0;
    this.east = 0;
    this.scale = 8;
    this.width = 1;
    this.height = 1;
  }

  x(east) {
    return this.width / 2 + (east - this.east) * this.scale;
  }

  y(north) {
    return this.height / 2 - (north - this.north) * this.scale;
  }

  // The place under a pixel.
  place(x, y) {
    return [this.north - (y - this.height / 2) / this.scale, this.east + (x - this.width / 2) / this.scale];
  }

  centre(north, east) {
    this.north = north;
    this.east = east;
  }

  pan(right, down) {
    this.east += right / this.scale;
    this.north -= down / this.scale;
  }

  // Zooms so that what is under (x, y) stays there; without a place, the centre does.
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const scale = Math.min(Math.max(this.scale * factor, SMALLEST), LARGEST);
    const right = x - this.width / 2;
    const down = y - this.height / 2;
    this.east += right / this.scale - right / scale;
    this.north -= down / this.scale - down / scale;
    this.scale = scale;
  }

  // Shows all places, [[north, east], ...], with a margin [m] around.
  fit(places, margin) {
    if (!places.length) return;
    const norths = places.map(([north]) => north);
    const easts = places.map(([, east]) => east);
    const [south, north] = [Math.min(...norths) - margin, Math.max(...norths) + margin];
    const [west, east] = [Math.min(...easts) - margin, Math.max(...easts) + margin];
    this.centre((south + north) / 2, (west + east) / 2);
    this.scale = Math.min(this.width / (east - west), this.height / (north - south));
    this.scale = Math.min(Math.max(this.scale, SMALLEST), LARGEST);
  }
}

export class Chart {
  constructor(canvas, camera, model, shown) {
    this.canvas = canvas;
    this.camera = camera;
    this.model = model;
    this.shown = shown; // which layers, { points: true, ... }
    this.alarms = () => []; // pairs that are too near: [{ vessel, track }, ...]
    this.measure = null; // [{ vessel } or { place }, the same], what the ruler lies between
    this.target = null; // [north, east] of an order that waits for its confirmation
    this.labels = []; // of the last picture: [{ x, y, width, height, words }, ...]
    this.waiting = false;
    new ResizeObserver(() => this.fitCanvas()).observe(canvas);
  }

  // Draws with the next picture of the screen, once, however often it is asked.
  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.#draw();
    });
  }

  // Takes the canvas's size; the observer does so only with the next picture of the screen.
  fitCanvas() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
    Object.assign(this.camera, { width, height });
    this.draw();
  }

  // Where an end of the ruler is now: it may be tied to a vessel.
  placeOf(end) {
    return end.vessel ? this.model.vessel(end.vessel)?.pose?.slice(0, 2) ?? null : end.place;
  }

  #draw() {
    const { camera, model, shown } = this;
    const pen = this.canvas.getContext("2d");
    pen.fillStyle = colours.water;
    pen.fillRect(0, 0, camera.width, camera.height);
    drawGrid(pen, camera);
    if (!model.greeting) return;
    const { scene, hull } = model.greeting;
    const followed = model.followed;
    if (followed?.pose) camera.centre(followed.pose[0], followed.pose[1]);
    const labels = new Labels(pen, camera, this.canvas);
    const zones = []; // what they are called, to be written when the boats' names stand
    drawScene(pen, camera, scene);
    if (!scene.regions.length) {
      // Without a scenario: what the vessel knows that is looked at, or else the first that has a chart.
      const { charts } = model.greeting;
      const known = followed ? charts[followed.name] : Object.values(charts).find((chart) => chart.length);
      for (const region of known ?? []) drawRegion(pen, camera, region);
    }
    this.#eachVessel(pen, (vessel, colour) => this.#drawBelow(pen, zones, vessel, colour));
    for (const vessel of model.vessels) {
      drawVessel(pen, camera, vessel, hull, vesselColour(model.index(vessel.name)));
      if (vessel.pose) labels.keepOff(camera.x(vessel.pose[1]), camera.y(vessel.pose[0]), 2.2 * camera.scale);
    }
    if (shown.points) this.#eachVessel(pen, (vessel, colour) => drawEchoes(pen, camera, vessel, colour));
    drawBuoys(pen, camera, scene);
    for (const pair of this.alarms()) drawAlarm(pen, camera, pair);
    this.#eachVessel(pen, (vessel, colour) => labelVessel(labels, camera, vessel, colour));
    for (const zone of zones) labels.put(...zone);
    this.labels = labels.drawn;
    if (this.target) drawTarget(pen, camera, this.target);
    if (this.measure) this.#drawRuler(pen);
    drawScaleBar(pen, camera);
    drawCompass(pen, camera, scene);
  }

  // What a vessel sees and wants. With many vessels, details are those of the followed one.
  #drawBelow(pen, zones, vessel, colour) {
    const { camera, model, shown } = this;
    const isFollowed = model.followed === vessel;
    const detailed = isFollowed || (!model.followed && model.vessels.length <= FEW);
    if (shown.trails) drawTrail(pen, camera, model.trail(vessel.name), colour);
    if (shown.zones && (isFollowed || !model.followed)) {
      drawZones(pen, camera, zones, vessel, model.greeting.zones, isFollowed);
    }
    if (shown.goals) drawRoute(pen, camera, vessel, colour);
    if (shown.goals) drawGoal(pen, camera, vessel, model.greeting.goal_radius_m, colour);
    if (shown.objects && detailed) drawObjects(pen, camera, vessel, colour);
    if (shown.tracks) drawTracks(pen, camera, vessel, colour, detailed);
  }

  // Those that are not followed are paler, if one is.
  #eachVessel(pen, draw) {
    const { followed } = this.model;
    for (const vessel of this.model.vessels) {
      pen.globalAlpha = !followed || followed === vessel ? 1 : PALE;
      draw(vessel, vesselColour(this.model.index(vessel.name)));
    }
    pen.globalAlpha = 1;
  }

  #drawRuler(pen) {
    const [from, to] = this.measure.map((end) => this.placeOf(end));
    if (!from || !to) return;
    const { camera } = this;
    const [[x0, y0], [x1, y1]] = [from, to].map(([north, east]) => [camera.x(east), camera.y(north)]);
    pen.strokeStyle = pen.fillStyle = colours.ink;
    pen.lineWidth = 1.5;
    line(pen, x0, y0, x1, y1);
    for (const [x, y] of [[x0, y0], [x1, y1]]) {
      pen.beginPath();
      pen.arc(x, y, 4, 0, 2 * Math.PI);
      pen.stroke();
    }
    const words = `${distance(from, to).toFixed(1)} m, ${compass(bearing(from, to))}`;
    write(pen, words, (x0 + x1) / 2, (y0 + y1) / 2 - 8, "center", true);
  }
}

// Words beside things, moved aside where they would lie on each other.
class Labels {
  constructor(pen, camera, canvas) {
    this.pen = pen;
    this.camera = camera;
    this.drawn = [];
    const origin = canvas.getBoundingClientRect();
    const over = [...canvas.parentElement.children].filter((element) => element !== canvas && !element.hidden);
    this.taken = over.map((element) => {
      const { x, y, width, height } = element.getBoundingClientRect();
      return { x: x - origin.x, y: y - origin.y, width, height };
    });
  }

  keepOff(x, y, half) {
    this.taken.push({ x: x - half, y: y - half, width: 2 * half, height: 2 * half });
  }

  // Writes lines of words near a place [px], `away` from it at least; the first line is bold.
  put(x, y, away, lines, colour) {
    const { pen } = this;
    const width = Math.max(...lines.map((words, i) => measureWords(pen, words, i === 0)));
    const height = LINE_PX * lines.length;
    const box = this.#free(x, y, away, width, height);
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    const [nearX, nearY] = [clamp(x, box.x, box.x + width), clamp(y, box.y, box.y + height)];
    pen.globalAlpha /= 2;
    if (Math.hypot(nearX - x, nearY - y) > away + 14) line(pen, x, y, nearX, nearY);
    pen.globalAlpha *= 2;
    lines.forEach((words, i) => {
      pen.fillStyle = i === 0 ? colour : colours.ink;
      write(pen, words, box.x, box.y + LINE_PX * (i + 1) - 4, "left", i === 0);
    });
    this.taken.push(box);
    this.drawn.push({ ...box, words: lines.join("\n") });
  }

  #free(x, y, away, width, height) {
    let best = null;
    for (const far of [away, away + 18, away + 40, away + 70]) {
      const d = far * 0.75;
      const places = [
        [x + d, y - d - height],
        [x + d, y + d],
        [x - d - width, y - d - height],
        [x - d - width, y + d],
        [x - width / 2, y - far - height],
        [x - width / 2, y + far],
        [x + far, y - height / 2],
        [x - far - width, y - height / 2],
      ];
      for (const [left, top] of places) {
        const box = {
          x: clamp(left, 4, this.camera.width - width - 4),
          y: clamp(top, 4, this.camera.height - height - 4),
          width,
          height,
        };
        const over = this.taken.reduce((sum, other) => sum + overlap(box, other), 0);
        if (over === 0) return box;
        if (!best || over < best.over) best = { box, over };
      }
    }
    return best.box;
  }
}

function overlap(a, b) {
  const wide = Math.min(a.x + a.width, b.x + b.width) - Math.max(a.x, b.x);
  const high = Math.min(a.y + a.height, b.y + b.height) - Math.max(a.y, b.y);
  return wide > 0 && high > 0 ? wide * high : 0;
}

function clamp(value, least, most) {
  return Math.max(Math.min(value, most), least);
}

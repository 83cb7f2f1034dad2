// Time: pause, slider and speed, the strip of events, and figures over time.

import { colours, vesselColour } from "./draw.js";
import { clock } from "./model.js";

const LIVE_S = 600; // the strip of events of a live view shows the last ten minutes
const STRIPS = [
  { name: "speed", unit: "m/s", columns: ["speed"], least: 0, atLeast: 1 },
  { name: "to goal", unit: "m", columns: ["to_goal"], least: 0, atLeast: 5 },
  { name: "nearest", unit: "m", columns: ["nearest"], least: 0, atLeast: 5, atMost: 30 },
  { name: "least CPA", unit: "m", columns: ["cpa"], least: 0, atLeast: 5, atMost: 15, limit: "cpa_m" },
  { name: "thrust, port and stbd", unit: "N", columns: ["left", "right"], least: -500, atLeast: 1000 },
  { name: "latency", unit: "ms", columns: ["latency"], least: 0, atLeast: 2 },
];
const STRIP_PX = 58;
const HEAD_PX = 14;
const LEFT_PX = 34;
const REFRESH_MS = 250;

export class Timeline {
  constructor(model, ask) {
    this.model = model;
    this.ask = ask;
    this.dragging = false;
    const find = (id) => document.getElementById(id);
    this.play = find("play");
    this.time = find("time");
    this.slider = find("slider");
    this.marks = find("marks");
    this.duration = find("duration");
    this.speed = find("speed");
    this.forRecordings = [this.slider, this.duration, find("speed-label")];
    this.play.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    this.slider.addEventListener("pointerdown", () => (this.dragging = true));
    this.slider.addEventListener("change", () => (this.dragging = false));
    this.speed.addEventListener("change", () => this.ask({ speed: Number(this.speed.value) }));
    this.marks.addEventListener("click", ({ offsetX }) => this.seek((offsetX / this.marks.clientWidth) * this.span[1]));
    new ResizeObserver(() => this.drawMarks()).observe(this.marks);
  }

  build() {
    const { duration_s: duration } = this.model.greeting;
    for (const element of this.forRecordings) element.hidden = this.model.isLive;
    this.slider.max = String(duration);
    this.duration.textContent = clock(duration);
    this.marked = null;
    if (Number(this.speed.value) !== 1) this.ask({ speed: Number(this.speed.value) });
  }

  // [s] What the strip of events shows: all of a recording, the last while of a live view.
  get span() {
    const { greeting, isLive, time } = this.model;
    return isLive ? [Math.max(0, time - LIVE_S), Math.max(time, 1)] : [0, Math.max(greeting?.duration_s ?? 0, 0.1)];
  }

  update() {
    const { time_s: time, playing } = this.model.frame;
    this.time.textContent = clock(time);
    if (!this.dragging) this.slider.value = String(time);
    this.slider.setAttribute("aria-valuetext", clock(time));
    this.play.textContent = playing ? "Pause" : "Play";
    this.play.setAttribute("aria-pressed", String(playing));
    this.drawMarks();
  }

  // A mark for each event: the worse, the taller.
  drawMarks() {
    const { model, marks } = this;
    if (!model.greeting) return;
    const events = [...model.events].flatMap(([name, all]) => all.map((one) => ({ ...one, vessel: name })));
    const state = model.isLive ? Math.floor(model.time) : 0;
    const drawn = [events.length, state, marks.clientWidth, marks.clientHeight, colours.ink, devicePixelRatio].join();
    if (drawn === this.marked) return;
    this.marked = drawn;
    const pen = canvasPen(marks);
    const [begin, end] = this.span;
    const { clientWidth: width, clientHeight: height } = marks;
    const tall = { info: 0.45, warning: 0.7, error: 1 };
    for (const { time, severity, vessel } of events) {
      const x = (width * (time - begin)) / (end - begin);
      pen.fillStyle = severity === "info" ? vesselColour(model.index(vessel)) : severity === "error" ? colours.danger : colours.caution;
      pen.fillRect(x - 1, height * (1 - tall[severity]), 2, height * tall[severity]);
    }
  }

  toggle() {
    this.ask({ playing: !this.model.playing });
  }

  seek(seconds) {
    if (!this.model.isLive) this.ask({ seek_s: seconds });
  }

  // Goes some seconds on (or back) and waits there.
  step(seconds) {
    if (this.model.isLive || !this.model.frame) return;
    this.ask({ playing: false, seek_s: this.model.frame.time_s + seconds });
  }
}

// Figures over time, a strip each, a line a vessel.
export class Figures {
  constructor(canvas, model, { seek, limits }) {
    this.canvas = canvas;
    this.model = model;
    this.limits = limits;
    this.drawnMs = 0;
    canvas.addEventListener("click", ({ offsetX }) => {
      const [begin, end] = this.#span();
      const share = (offsetX - LEFT_PX) / (canvas.clientWidth - LEFT_PX);
      seek(begin + Math.max(share, 0) * (end - begin));
    });
    new ResizeObserver(() => this.update(true)).observe(canvas);
  }

  update(always = false) {
    const { canvas, model } = this;
    if (!model.greeting || !canvas.clientWidth) return; // another tab is open
    const now = performance.now();
    if (!always && model.playing && now - this.drawnMs < REFRESH_MS) return;
    this.drawnMs = now;
    const strips = STRIPS.filter(({ columns }) => columns.some((column) => this.#has(column)));
    canvas.style.height = `${Math.max(strips.length, 1) * STRIP_PX}px`;
    const pen = canvasPen(canvas);
    strips.forEach((strip, i) => this.#strip(pen, strip, i * STRIP_PX));
  }

  #has(column) {
    const at = this.model.greeting.series.columns.indexOf(column);
    return [...this.model.series.values()].some((rows) => rows.some((row) => row[at] !== null));
  }

  #span() {
    const { greeting, isLive, time } = this.model;
    const begin = isLive ? Math.min(...[...this.model.series.values()].map((rows) => rows[0]?.[0] ?? time)) : 0;
    return [begin, Math.max(isLive ? time : greeting.duration_s, begin + 1)];
  }

  #strip(pen, { name, unit, columns, least, atLeast, atMost = Infinity, limit }, top) {
    const { model, canvas } = this;
    const at = columns.map((column) => model.greeting.series.columns.indexOf(column));
    const shown = [...model.series].map(([vessel, rows]) => [vessel, rows]);
    const largest = Math.max(...shown.flatMap(([, rows]) => rows.flatMap((row) => at.map((column) => row[column] ?? 0))), atLeast);
    const most = Math.min(largest, atMost);
    const [begin, end] = this.#span();
    const x = (time) => LEFT_PX + ((canvas.clientWidth - LEFT_PX) * (time - begin)) / (end - begin);
    const height = STRIP_PX - HEAD_PX - 6;
    const y = (value) => top + HEAD_PX + height * (1 - (Math.min(Math.max(value, least), most) - least) / (most - least));
    pen.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    pen.fillStyle = colours.faint;
    pen.textAlign = "left";
    pen.fillText(`${name} [${unit}]`, LEFT_PX, top + 10);
    pen.textAlign = "right";
    pen.fillText(most.toFixed(most < 10 ? 1 : 0), LEFT_PX - 4, y(most) + 7);
    pen.fillText(least.toFixed(0), LEFT_PX - 4, y(least) + 1);
    rule(pen, colours.grid, [], LEFT_PX, y(least), canvas.clientWidth, y(least));
    rule(pen, colours.grid, [], LEFT_PX, y(most), canvas.clientWidth, y(most));
    if (limit) rule(pen, colours.danger, [4, 3], LEFT_PX, y(this.limits()[limit]), canvas.clientWidth, y(this.limits()[limit]));
    for (const [vessel, rows] of shown) {
      pen.globalAlpha = !model.following || model.following === vessel ? 1 : 0.2;
      pen.strokeStyle = vesselColour(model.index(vessel));
      at.forEach((column, side) => {
        pen.setLineDash(side ? [3, 2] : []);
        plot(pen, rows, column, x, y);
      });
    }
    pen.globalAlpha = 1;
    rule(pen, colours.ink, [], x(model.time), top + HEAD_PX - 3, x(model.time), top + STRIP_PX - 5);
  }
}

function plot(pen, rows, column, x, y) {
  pen.lineWidth = 1.3;
  pen.beginPath();
  let down = false;
  for (const row of rows) {
    if (row[column] === null) {
      down = false;
      continue;
    }
    if (down) pen.lineTo(x(row[0]), y(row[column]));
    else pen.moveTo(x(row[0]), y(row[column]));
    down = true;
  }
  pen.stroke();
  pen.setLineDash([]);
}

function rule(pen, colour, dashes, x0, y0, x1, y1) {
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.setLineDash(dashes);
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
  pen.setLineDash([]);
}

// Fits a canvas to its place, empties it, and gives its pen in CSS pixels.
function canvasPen(canvas) {
  const ratio = devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return pen;
}

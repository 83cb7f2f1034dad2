// What the page knows, and the line to the server that tells it.
// hil_sim/viewer/wire.py says how frames are laid out.

export const VERSION = 2;

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 3000;
const MOST_PLACES = 4000;
const STEP_M = 0.5; // between two places of a trail
const MOST_LATENCIES = 150;
const MOST_ROWS = 3000;
const MOST_EVENTS = 1000;
const ROW_S = 0.2; // between two rows of a time series
const SILENT_S = 1;
const SAME_M = 3; // a track this near to where another vessel says it is, is that vessel

// Keeps a WebSocket to the server; when it breaks, tries again until it is back.
export class Connection {
  // `on` has greeting(object), frame(object), answer(words) and state("open" or "lost").
  constructor(on) {
    this.on = on;
    this.wait = FIRST_WAIT_MS;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/frames`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.wait = FIRST_WAIT_MS;
      this.on.state("open");
    };
    this.socket.onmessage = ({ data }) => {
      if (typeof data !== "string") this.on.frame(decodeFrame(data));
      else {
        const words = JSON.parse(data);
        if (words.answer !== undefined) this.on.answer(words.answer);
        else this.on.greeting(words);
      }
    };
    this.socket.onclose = () => {
      this.on.state("lost");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    };
  }

  ask(request) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(request));
  }
}

export function decodeFrame(buffer) {
  const headSize = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, headSize)));
  let at = 4 + headSize;
  for (const vessel of head.vessels) {
    const numbers = 2 * vessel.points;
    vessel.echoes = new Int16Array(buffer, at, numbers); // [cm] north, east of the vessel
    vessel.tracks = vessel.tracks.map(track);
    vessel.events = vessel.events.map(event);
    at += 2 * numbers;
  }
  return head;
}

function track([id, north, east, vNorth, vEast, radius, unseen, situation, gap, cpa, tcpa]) {
  return { id, north, east, vNorth, vEast, radius, unseen, situation, gap, cpa, tcpa };
}

function event([time, name, severity, detail]) {
  return { time, name, severity, detail };
}

export class Model {
  constructor() {
    this.greeting = null;
    this.frame = null;
    this.following = null; // a vessel's name
    this.playing = true;
    this.jumped = true; // whether the newest frame is not the one after the frame before
    this.trails = new Map(); // name -> [[time, north, east], ...]
    this.series = new Map(); // name -> [[time, speed, ...], ...], columns as greeting.series
    this.events = new Map(); // name -> [{ time, name, severity, detail }, ...]
    this.latencies = new Map(); // name -> [ms, ...]
  }

  greet(greeting) {
    this.greeting = greeting;
    this.frame = null;
    this.trails = new Map(Object.entries(greeting.trails));
    this.series = new Map(Object.entries(greeting.series.rows));
    this.events = new Map(Object.entries(greeting.events).map(([name, all]) => [name, all.map(event)]));
    this.eventCounts = new Map();
    this.latencies = new Map(greeting.names.map((name) => [name, []]));
    if (!greeting.names.includes(this.following)) this.following = null;
  }

  take(frame) {
    const before = this.frame?.time_s;
    this.frame = frame;
    this.playing = frame.playing;
    this.jumped = before === undefined || frame.time_s < before || frame.time_s > before + 3;
    for (const vessel of frame.vessels) {
      if (this.isLive) this.#lengthen(vessel);
      const history = this.latencies.get(vessel.name);
      if (this.jumped) history.length = 0;
      if (vessel.latency_ms !== null) history.push(vessel.latency_ms);
      if (history.length > MOST_LATENCIES) history.shift();
      for (const one of vessel.tracks) one.name = this.#nameOf(vessel, one);
    }
  }

  get isLive() {
    return this.greeting?.mode === "live";
  }

  get vessels() {
    return this.frame?.vessels ?? [];
  }

  get followed() {
    return this.vessels.find((vessel) => vessel.name === this.following) ?? null;
  }

  get time() {
    return this.frame?.time_s ?? 0;
  }

  vessel(name) {
    return this.vessels.find((vessel) => vessel.name === name) ?? null;
  }

  index(name) {
    return this.greeting.names.indexOf(name);
  }

  // Where a vessel was until the present frame.
  trail(name) {
    return this.#until(this.trails.get(name) ?? [], ([time]) => time);
  }

  // What happened until the present frame: [{ vessel, time, name, severity, detail }, ...].
  happened() {
    const all = this.greeting.names.flatMap((vessel) =>
      this.#until(this.events.get(vessel) ?? [], ({ time }) => time).map((one) => ({ ...one, vessel })),
    );
    return all.sort((a, b) => a.time - b.time);
  }

  // [m, m] -> [deg, deg] if it is known where the origin lies (runtime/link/datum.py).
  degrees(north, east) {
    const datum = this.greeting?.datum;
    if (!datum) return null;
    const radius = 6378137;
    const perRadian = 180 / Math.PI;
    const latitude = datum.latitude_deg + (north / radius) * perRadian;
    const halfWay = (latitude + datum.latitude_deg) / 2 / perRadian;
    return [latitude, datum.longitude_deg + (east / (radius * Math.cos(halfWay))) * perRadian];
  }

  #until(rows, timeOf) {
    if (this.isLive) return rows;
    let [low, high] = [0, rows.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (timeOf(rows[middle]) <= this.time) low = middle + 1;
      else high = middle;
    }
    return rows.slice(0, low);
  }

  // A live frame makes trail, time series and events longer.
  #lengthen(vessel) {
    const { name, pose, events, event_count: count } = vessel;
    const known = this.events.get(name) ?? [];
    const before = this.eventCounts.get(name) ?? count; // the greeting told the events before
    known.push(...(count > before ? events.slice(before - count) : []));
    this.eventCounts.set(name, count);
    known.splice(0, Math.max(0, known.length - MOST_EVENTS));
    this.events.set(name, known);
    if (pose === null) return;
    const places = this.trails.get(name) ?? [];
    const last = places.at(-1);
    if (!last || Math.hypot(pose[0] - last[1], pose[1] - last[2]) >= STEP_M) {
      places.push([this.time, pose[0], pose[1]]);
      if (places.length > MOST_PLACES) places.shift();
      this.trails.set(name, places);
    }
    const rows = this.series.get(name) ?? [];
    if (!rows.length || this.time - rows.at(-1)[0] >= ROW_S) rows.push(seriesRow(this.time, vessel));
    if (rows.length > MOST_ROWS) rows.shift();
    this.series.set(name, rows);
  }

  // The name of the vessel that a track is, if it is one of those that are shown.
  #nameOf(own, { north, east }) {
    const near = ({ name, pose }) =>
      name !== own.name && pose && Math.hypot(pose[0] - north, pose[1] - east) < SAME_M;
    return this.vessels.find(near)?.name ?? "";
  }
}

function seriesRow(time, { velocity, pose, goal, tracks, thrust, latency_ms: latency, ended }) {
  const toGoal = pose && goal ? distance(pose, goal) : null;
  if (ended) return [time, 0, toGoal, null, null, null, null, null];
  const least = (values) => (values.length ? Math.min(...values) : null);
  const soon = tracks.filter(({ tcpa }) => tcpa < 20).map(({ cpa }) => cpa);
  const nearest = least(tracks.map(({ gap }) => gap));
  return [time, velocity ? Math.hypot(...velocity) : null, toGoal, nearest, least(soon), ...(thrust ?? [null, null]), latency];
}

// Whether a vessel gives no sign of life, and should.
export function isSilent({ silent_s: silent, ended }) {
  return !ended && (silent === null || silent > SILENT_S);
}

export function distance([north, east], [otherNorth, otherEast]) {
  return Math.hypot(otherNorth - north, otherEast - east);
}

// [rad] clockwise from north, as "045\u00b0".
export function compass(angle) {
  const degrees = Math.round((angle * 180) / Math.PI);
  return `${String(((degrees % 360) + 360) % 360).padStart(3, "0")}\u00b0`;
}

export function bearing([north, east], [otherNorth, otherEast]) {
  return Math.atan2(otherEast - east, otherNorth - north);
}

// Of the way over ground, or while it lies still, of the bow.
export function courseOf({ pose, velocity }) {
  return velocity && Math.hypot(...velocity) > 0.3 ? Math.atan2(velocity[1], velocity[0]) : pose[2];
}

export function clock(seconds) {
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${(seconds - 60 * minutes).toFixed(1).padStart(4, "0")}`;
}

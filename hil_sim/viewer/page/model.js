// What is known: the greeting, the newest frame, trails and latencies, what is followed.

const MOST_PLACES = 4000;
const STEP_M = 0.5;
const MOST_LATENCIES = 150;

export class Model {
  constructor() {
    this.greeting = null;
    this.frame = null;
    this.following = null; // a vessel's name
    this.playing = true;
    this.trails = new Map(); // name -> [[time, north, east], ...]
    this.latencies = new Map(); // name -> [ms, ...]
  }

  greet(greeting) {
    this.greeting = greeting;
    this.frame = null;
    this.trails = new Map(Object.entries(greeting.trails));
    this.latencies = new Map(greeting.names.map((name) => [name, []]));
    if (!greeting.names.includes(this.following)) this.following = null;
  }

  take(frame) {
    const before = this.frame?.time_s;
    this.frame = frame;
    this.playing = frame.playing;
    const jumped = before !== undefined && (frame.time_s < before || frame.time_s > before + 3);
    for (const vessel of frame.vessels) {
      if (this.isLive) this.#lengthen(vessel);
      const history = this.latencies.get(vessel.name);
      if (jumped) history.length = 0;
      if (vessel.latency_ms !== null) history.push(vessel.latency_ms);
      if (history.length > MOST_LATENCIES) history.shift();
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

  index(name) {
    return this.greeting.names.indexOf(name);
  }

  // Where a vessel was until the present frame.
  trail(name) {
    const places = this.trails.get(name) ?? [];
    if (this.isLive) return places;
    const until = this.frame?.time_s ?? 0;
    let [low, high] = [0, places.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (places[middle][0] <= until) low = middle + 1;
      else high = middle;
    }
    return places.slice(0, low);
  }

  #lengthen({ name, pose }) {
    if (pose === null) return;
    const places = this.trails.get(name) ?? [];
    const last = places.at(-1);
    if (last && Math.hypot(pose[0] - last[1], pose[1] - last[2]) < STEP_M) return;
    places.push([this.frame.time_s, pose[0], pose[1]]);
    if (places.length > MOST_PLACES) places.shift();
    this.trails.set(name, places);
  }
}

// The watch: alarms that want to be acknowledged, every track's closest approach, what happened.

import { bearing, clock, compass, isSilent } from "./model.js";
import { colours, vesselColour } from "./draw.js";

const HOLD_S = 0.3; // a track must be too near for this long: one scan may err
const OVER_S = 1; // and not be so for this long before the alarm is over
const UNSEEN_S = 2; // a track that was not seen for longer is no reason for an alarm
const MOST_ROWS = 14;
const MOST_ALARMS = 3; // lines over the chart; the rest is counted
const MOST_LINES = 200;
const REFRESH_MS = 200;
const LIMITS_KEY = "twinscrew limits";

// Which alarms there are. Each is active or over, and acknowledged or not; who is over and
// acknowledged is gone.
export class Alarms {
  constructor() {
    this.all = new Map(); // key -> { key, words, vessel, track, active, acknowledged, raised }
    this.log = []; // what was raised and acknowledged: { time, vessel, name, severity, detail }
    this.frame = null; // the one taken in last: it may be looked at again with other limits
  }

  // Takes in a frame; gives those that are new.
  step(model, limits) {
    if (model.jumped && model.frame !== this.frame) {
      this.all.clear();
      this.log = [];
    }
    this.frame = model.frame;
    const { time } = model;
    const holding = new Map(conditions(model, limits).map((one) => [one.key, one]));
    const raised = [];
    for (const one of holding.values()) {
      const alarm = this.all.get(one.key) ?? { ...one, since: time, shown: false, acknowledged: false };
      Object.assign(alarm, one, { last: time, active: true });
      if (!alarm.shown && (model.jumped || !model.playing || !one.track || time - alarm.since >= HOLD_S)) {
        alarm.shown = true;
        raised.push(alarm);
        this.#note(time, alarm, "alarm", "error");
      }
      this.all.set(one.key, alarm);
    }
    for (const [key, alarm] of this.all) {
      if (holding.has(key)) continue;
      alarm.active = alarm.active && time - alarm.last < OVER_S;
      if (!alarm.shown || (!alarm.active && alarm.acknowledged)) this.all.delete(key);
    }
    return raised;
  }

  get shown() {
    const rank = ({ active, acknowledged, tcpa = 0 }) => 1e6 * Number(!active) + 1e3 * Number(acknowledged) + tcpa;
    return [...this.all.values()].filter(({ shown }) => shown).sort((a, b) => rank(a) - rank(b));
  }

  acknowledge(alarm, time) {
    if (alarm.acknowledged) return;
    alarm.acknowledged = true;
    this.#note(time, alarm, "acknowledged", "info");
    if (!alarm.active) this.all.delete(alarm.key);
  }

  #note(time, { vessel, words }, name, severity) {
    this.log.push({ time, vessel: vessel.name, name, severity, detail: words });
    if (this.log.length > MOST_LINES) this.log.shift();
  }
}

// What is wrong in a frame: [{ key, words, vessel, track, tcpa }, ...]. Two vessels that come near
// each other are one alarm, of the one that is nearer to trouble.
export function conditions(model, limits) {
  const found = new Map();
  for (const vessel of model.vessels) {
    const { name, ended } = vessel;
    if (ended?.outcome === "collision") {
      found.set(`end ${name}`, { key: `end ${name}`, vessel, words: `${name} has collided` });
    }
    if (ended) continue;
    if (isSilent(vessel) && vessel.pose) {
      found.set(`silent ${name}`, { key: `silent ${name}`, vessel, words: `${name} has been silent for ${vessel.silent_s.toFixed(0)} s` });
      continue;
    }
    if (vessel.state === "safe") {
      const why = vessel.events.filter(({ severity }) => severity === "error").at(-1);
      const words = `${name} has stopped its propellers${why ? `: ${why.name.replaceAll("_", " ")}` : ""}`;
      found.set(`safe ${name}`, { key: `safe ${name}`, vessel, words });
    }
    for (const track of vessel.tracks) {
      if (!isTooNear(track, limits)) continue;
      const key = `cpa ${[name, track.name || `${name} ${track.id}`].sort().join(" ")}`;
      const other = track.name || `track ${track.id}`;
      const words = `${name} and ${other}: ${nearWords(track)}`;
      if (!found.has(key) || track.tcpa < found.get(key).tcpa) {
        found.set(key, { key, vessel, track, words, tcpa: track.tcpa });
      }
    }
  }
  return [...found.values()];
}

export function isTooNear({ cpa, tcpa, unseen }, limits) {
  return unseen <= UNSEEN_S && tcpa > 0 && tcpa < limits.tcpa_s && cpa < limits.cpa_m;
}

export function nearWords({ cpa, tcpa }) {
  return cpa <= 0 ? `contact in ${tcpa.toFixed(1)} s` : `CPA ${cpa.toFixed(1)} m in ${tcpa.toFixed(1)} s`;
}

export class Watch {
  // `on` has follow(name), seek(time).
  constructor(model, on) {
    this.model = model;
    this.on = on;
    this.alarms = new Alarms();
    this.lines = new Map(); // alarm's key -> its element, kept so that it can be clicked
    this.drawnMs = 0;
    this.audio = null;
    const find = (id) => document.getElementById(id);
    [this.bar, this.table, this.list] = [find("alarms"), find("tracks"), find("events")];
    this.inputs = { cpa_m: find("cpa-limit"), tcpa_s: find("tcpa-limit") };
    this.sound = find("sound");
    this.sound.addEventListener("change", () => this.#beep());
    for (const [name, input] of Object.entries(this.inputs)) {
      input.addEventListener("change", () => {
        if (Number(input.value) >= 0) this.limits[name] = Number(input.value);
        localStorage.setItem(LIMITS_KEY, JSON.stringify(this.limits));
        this.update(true);
      });
    }
    // Rows are made anew several times a second: what is pressed need not be there when let go.
    this.table.addEventListener("pointerdown", ({ target }) => {
      const row = target.closest("tr[data-vessel]");
      if (row) on.follow(row.dataset.vessel);
    });
    this.list.addEventListener("click", ({ target }) => {
      const line = target.closest("li[data-time]");
      if (line) on.seek(Number(line.dataset.time));
    });
  }

  build() {
    this.limits = { ...this.model.greeting.limits, ...remembered() };
    for (const [name, input] of Object.entries(this.inputs)) input.value = String(this.limits[name]);
    this.alarms = new Alarms();
    this.#show();
  }

  // Pairs that are too near now, for the chart.
  get pairs() {
    return this.alarms.shown.filter(({ track, active, last }) => track && active && last === this.model.time);
  }

  update(always = false) {
    const raised = this.alarms.step(this.model, this.limits);
    if (raised.length) this.#beep();
    this.#show();
    const now = performance.now();
    if (!always && this.model.playing && !this.model.jumped && now - this.drawnMs < REFRESH_MS) return;
    this.drawnMs = now;
    this.#fillTable();
    this.#fillList();
  }

  acknowledge(only = null) {
    for (const alarm of this.alarms.shown) {
      if (!only || alarm === only) this.alarms.acknowledge(alarm, this.model.time);
    }
    this.update(true);
  }

  // A line for each alarm that is active; one for all those that are over and not acknowledged.
  #show() {
    const { shown } = this.alarms;
    const active = shown.filter((alarm) => alarm.active);
    const wanted = shown.filter(({ acknowledged }) => !acknowledged);
    document.body.dataset.alarms = String(wanted.length);
    const first = active.slice(0, MOST_ALARMS);
    const keys = new Set(first.map(({ key }) => key));
    for (const key of this.lines.keys()) if (!keys.has(key)) this.lines.delete(key);
    const elements = first.map((alarm) => this.#line(alarm));
    const past = shown.length - active.length;
    if (wanted.length > 1 || past) elements.push(this.#allLine(wanted, active.length - first.length, past));
    const before = [...this.bar.children];
    if (before.length !== elements.length || before.some((element, i) => element !== elements[i])) {
      this.bar.replaceChildren(...elements);
    }
    this.bar.hidden = !elements.length;
  }

  #line(alarm) {
    let line = this.lines.get(alarm.key);
    if (!line) {
      line = document.createElement("li");
      const words = document.createElement("span");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = "Acknowledge";
      button.addEventListener("click", () => this.acknowledge(this.alarms.all.get(alarm.key)));
      line.append(words, button);
      this.lines.set(alarm.key, line);
    }
    line.dataset.state = alarm.acknowledged ? "acknowledged" : "active";
    if (line.firstChild.textContent !== alarm.words) line.firstChild.textContent = alarm.words;
    line.lastChild.hidden = alarm.acknowledged;
    return line;
  }

  #allLine(wanted, hidden, past) {
    if (!this.all) {
      this.all = document.createElement("li");
      this.all.dataset.state = "all";
      const button = document.createElement("button");
      button.type = "button";
      button.addEventListener("click", () => this.acknowledge());
      this.all.append(document.createElement("span"), button);
    }
    const words = [hidden > 0 ? `${hidden} more` : "", past > 0 ? `${past} past alarm${past > 1 ? "s" : ""}` : ""];
    this.all.firstChild.textContent = words.filter(Boolean).join(", ");
    this.all.title = wanted.map((alarm) => alarm.words).join("\n");
    this.all.lastChild.textContent = wanted.length > 1 ? `Acknowledge all ${wanted.length}` : "Acknowledge";
    return this.all;
  }

  #fillTable() {
    const { model } = this;
    const chosen = model.followed ? [model.followed] : model.vessels;
    const pairs = chosen.flatMap((vessel) => (vessel.ended ? [] : vessel.tracks.map((track) => ({ vessel, track }))));
    const urgency = ({ track: { cpa, tcpa, gap } }) => (tcpa > 0 ? cpa + tcpa / 2 : 1e3 + gap);
    pairs.sort((a, b) => urgency(a) - urgency(b));
    this.table.replaceChildren(...pairs.slice(0, MOST_ROWS).map((pair) => this.#row(pair)));
  }

  #row({ vessel, track }) {
    const row = document.createElement("tr");
    row.dataset.vessel = vessel.name;
    if (isTooNear(track, this.limits)) row.dataset.alarm = "";
    if (vessel.about === track.id) row.dataset.about = "";
    const still = Math.hypot(track.vNorth, track.vEast) < this.model.greeting.zones.min_speed_mps;
    const rule = { 1: "14", 2: "15" }[track.situation] ?? (still ? "still" : "");
    const cells = [
      vessel.name,
      track.name || `track ${track.id}`,
      `${Math.max(track.gap, 0).toFixed(1)}`,
      compass(bearing(vessel.pose, [track.north, track.east])),
      track.tcpa > 0 ? (track.cpa <= 0 ? "contact" : track.cpa.toFixed(1)) : "\u2013",
      track.tcpa > 0 ? (track.tcpa > 99 ? ">99" : track.tcpa.toFixed(1)) : "opening",
      rule,
    ];
    row.append(
      ...cells.map((words) => {
        const cell = document.createElement("td");
        cell.textContent = words;
        return cell;
      }),
    );
    row.firstChild.style.color = vesselColour(this.model.index(vessel.name));
    return row;
  }

  #fillList() {
    const { model } = this;
    const happened = [...model.happened(), ...this.alarms.log].sort((a, b) => a.time - b.time);
    const chosen = happened.filter(({ vessel }) => !model.following || vessel === model.following).slice(-MOST_LINES);
    const mark = `${chosen.length} ${chosen.at(-1)?.time} ${chosen.at(-1)?.name} ${model.following} ${colours.ink}`;
    if (mark === this.filled) return;
    this.filled = mark;
    this.list.replaceChildren(...chosen.reverse().map((one) => this.#eventLine(one)));
  }

  #eventLine({ time, vessel, name, severity, detail }) {
    const line = document.createElement("li");
    Object.assign(line.dataset, { severity, time, name });
    const [when, who, what] = ["time", "b", "span"].map((kind) => document.createElement(kind));
    when.textContent = clock(time);
    who.textContent = vessel;
    who.style.color = vesselColour(this.model.index(vessel));
    what.textContent = `${name.replaceAll("_", " ")}${detail ? `: ${detail}` : ""}`;
    line.title = what.textContent;
    line.append(when, who, what);
    return line;
  }

  #beep() {
    if (!this.sound.checked) return;
    this.audio ??= new AudioContext();
    const tone = this.audio.createOscillator();
    const volume = this.audio.createGain();
    volume.gain.value = 0.1;
    tone.frequency.value = 880;
    tone.connect(volume).connect(this.audio.destination);
    tone.start();
    tone.stop(this.audio.currentTime + 0.15);
  }
}

function remembered() {
  try {
    return JSON.parse(localStorage.getItem(LIMITS_KEY)) ?? {};
  } catch {
    return {};
  }
}

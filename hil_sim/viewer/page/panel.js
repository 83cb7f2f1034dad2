// The cards at the side: what a vessel is doing and why, in words and figures.

import { colours, vesselColour } from "./draw.js";
import { compass, courseOf, distance, isSilent } from "./model.js";

const FEW = 2; // more vessels than this have shorter cards
const NOTHING = "\u2013";
const ENDS = { goal: "arrived", collision: "collided", timeout: "out of time" };

export class Panel {
  // `on` has follow(name), and for views that may give orders, send(name) and stop(name).
  constructor(aside, template, model, on) {
    this.aside = aside;
    this.template = template;
    this.model = model;
    this.on = on;
    this.cards = new Map();
  }

  // Makes a card for every vessel that the greeting names.
  build() {
    this.cards = new Map(this.model.greeting.names.map((name) => [name, this.#card(name)]));
    this.aside.classList.toggle("many", this.cards.size > FEW);
    this.aside.replaceChildren(...this.cards.values());
    this.paint();
  }

  paint() {
    for (const [name, card] of this.cards) {
      card.style.setProperty("--own", vesselColour(this.model.index(name)));
    }
  }

  update() {
    for (const vessel of this.model.vessels) this.#update(this.cards.get(vessel.name), vessel);
    for (const [name, card] of this.cards) {
      const followed = name === this.model.following;
      card.classList.toggle("followed", followed);
      card.querySelector(".follow").setAttribute("aria-pressed", String(followed));
    }
  }

  #card(name) {
    const card = this.template.content.firstElementChild.cloneNode(true);
    card.dataset.vessel = name;
    card.querySelector(".name").textContent = name;
    card.querySelector(".follow").title = `Follow ${name}`;
    card.querySelector(".follow").addEventListener("click", () => this.on.follow(name));
    card.querySelector(".send").addEventListener("click", () => this.on.send(name));
    card.querySelector(".halt").addEventListener("click", () => this.on.stop(name));
    const { min_n: least, max_n: most } = this.model.greeting.thrust;
    for (const bar of card.querySelectorAll(".bar")) {
      bar.style.setProperty("--zero", `${(100 * -least) / (most - least)}%`);
    }
    return card;
  }

  #update(card, vessel) {
    const silent = isSilent(vessel);
    const ended = ENDS[vessel.ended?.outcome] ?? vessel.ended?.outcome;
    const state = ended ?? (silent ? "silent" : vessel.arrived ? "arrived" : vessel.state);
    const badge = card.querySelector(".state");
    badge.textContent = badge.dataset.state = state;
    card.classList.toggle("silent", silent);
    card.classList.toggle("ended", Boolean(ended));
    card.querySelector(".orders").hidden = !this.model.greeting.orders || Boolean(ended);
    const why = silent ? silentWords(vessel) : named(vessel);
    write(card, ".why", why);
    card.querySelector(".why").title = why;
    this.#figures(card, vessel);
    this.#propellers(card, vessel.thrust);
    const outside = vessel.envelope.startsWith("none:") ? "" : vessel.envelope && `outside its envelope: ${vessel.envelope}`;
    const drives = vessel.engaged === null ? "" : vessel.engaged ? "policy drives" : "policy does not drive";
    write(card, ".autopilot", vessel.ended ? "" : [vessel.autopilot, drives, outside].filter(Boolean).join(", "));
    card.querySelector(".autopilot").title = vessel.envelope;
    const ms = vessel.latency_ms;
    card.querySelector(".latency").hidden = ms === null;
    write(card, ".ms", ms === null ? NOTHING : `${ms.toFixed(1)} ms`);
    if (ms !== null) drawSparkline(card.querySelector(".spark"), this.model.latencies.get(vessel.name), colours.faint);
  }

  #figures(card, vessel) {
    const { pose, velocity, goal } = vessel;
    write(card, ".speed", velocity ? `${Math.hypot(...velocity).toFixed(1)} m/s` : NOTHING);
    write(card, ".course", pose ? compass(courseOf(vessel)) : NOTHING);
    write(card, ".to-goal", pose && goal ? `${distance(pose, goal).toFixed(1)} m` : NOTHING);
    const nearest = vessel.tracks.length ? Math.min(...vessel.tracks.map(({ gap }) => gap)) : null;
    const closest = vessel.ended?.closest_approach_m ?? nearest;
    write(card, ".nearest-label", vessel.ended ? "closest was" : "nearest");
    write(card, ".nearest", closest === null ? NOTHING : `${Math.max(closest, 0).toFixed(1)} m`);
  }

  #propellers(card, thrust) {
    const { min_n: least, max_n: most } = this.model.greeting.thrust;
    const percent = (newtons) => (100 * (newtons - least)) / (most - least);
    const words = card.querySelectorAll(".newtons");
    card.querySelectorAll(".bar i").forEach((bar, side) => {
      const newtons = thrust ? thrust[side] : 0;
      bar.style.left = `${percent(Math.min(newtons, 0))}%`;
      bar.style.width = `${percent(Math.max(newtons, 0)) - percent(Math.min(newtons, 0))}%`;
      words[side].textContent = thrust ? `${Math.round(newtons)} N` : NOTHING;
    });
  }
}

// The sentence, with the names of those tracks that are vessels on this page.
function named({ why, tracks }) {
  return why.replace(/track (\d+)/gi, (words, id) => tracks.find((track) => String(track.id) === id)?.name || words);
}

function silentWords({ silent_s: silent }) {
  if (silent === null) return "Nothing has been heard of it yet: is it switched on, and its name right?";
  return `No odometry for ${silent.toFixed(0)} s: is it switched on and in reach? "twinscrew doctor --listen" says what comes.`;
}

function write(card, selector, words) {
  const element = card.querySelector(selector);
  if (element.textContent !== words) element.textContent = words;
}

// The last latencies as a line; its top is the largest of them, at least 1 ms.
export function drawSparkline(canvas, values, colour) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  if (values.length < 2) return;
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  const top = Math.max(1, ...values);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.2;
  pen.lineJoin = "round";
  pen.beginPath();
  values.forEach((value, i) => {
    pen.lineTo((i / (values.length - 1)) * width, height - 1.5 - (value / top) * (height - 3));
  });
  pen.stroke();
}

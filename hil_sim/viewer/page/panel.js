// The cards at the side: what a vessel is doing, in words and figures.

import { vesselColour, colours } from "./theme.js";
import { drawSparkline } from "./sparkline.js";

const SILENT_S = 1;
const SLACK_M = 0.5; // between two messages of odometry
const SHOWN_EVENTS = 3;
const FEW = 3; // more vessels than this have shorter cards
const TURN = 2 * Math.PI;

export class Panel {
  constructor(aside, template, model, follow) {
    this.aside = aside;
    this.template = template;
    this.model = model;
    this.follow = follow;
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
    card.querySelector(".follow").addEventListener("click", () => this.follow(name));
    const { min_n: least, max_n: most } = this.model.greeting.thrust;
    for (const bar of card.querySelectorAll(".bar")) {
      bar.style.setProperty("--zero", `${(100 * -least) / (most - least)}%`);
    }
    return card;
  }

  #update(card, vessel) {
    const silent = vessel.silent_s === null || vessel.silent_s > SILENT_S;
    const state = this.#hasArrived(vessel, silent) ? "arrived" : silent ? "silent" : vessel.state;
    const badge = card.querySelector(".state");
    badge.textContent = badge.dataset.state = state;
    card.classList.toggle("silent", silent);
    this.#figures(card, vessel);
    this.#propellers(card, vessel.thrust);
    const ms = vessel.latency_ms;
    card.querySelector(".ms").textContent = ms === null ? "\u2013" : `${ms.toFixed(1)} ms`;
    drawSparkline(card.querySelector(".spark"), this.model.latencies.get(vessel.name), colours.faint);
    const brief = this.cards.size > FEW && vessel.name !== this.model.following;
    const events = vessel.events.slice(brief ? -1 : -SHOWN_EVENTS).reverse();
    card.querySelector(".events").replaceChildren(...events.map(eventLine));
  }

  // A simulator takes a vessel out of its run where it reaches its goal, before it could say so.
  #hasArrived({ arrived, pose, goal }, silent) {
    if (arrived || !silent || !pose || !goal) return arrived;
    return Math.hypot(goal[0] - pose[0], goal[1] - pose[1]) <= this.model.greeting.goal_radius_m + SLACK_M;
  }

  #figures(card, { pose, velocity, goal }) {
    const write = (name, words) => {
      card.querySelector(name).textContent = words;
    };
    write(".speed", velocity ? `${Math.hypot(...velocity).toFixed(1)} m/s` : "\u2013");
    const degrees = pose ? Math.round((((pose[2] + TURN) % TURN) * 360) / TURN) % 360 : 0;
    write(".heading", pose ? `${String(degrees).padStart(3, "0")}\u00b0` : "\u2013");
    const far = pose && goal ? Math.hypot(goal[0] - pose[0], goal[1] - pose[1]) : null;
    write(".to-goal", far === null ? "\u2013" : `${far.toFixed(1)} m`);
  }

  #propellers(card, thrust) {
    const { min_n: least, max_n: most } = this.model.greeting.thrust;
    const percent = (newtons) => (100 * (newtons - least)) / (most - least);
    const words = card.querySelectorAll(".newtons");
    card.querySelectorAll(".bar i").forEach((bar, side) => {
      const newtons = thrust ? thrust[side] : 0;
      bar.style.left = `${percent(Math.min(newtons, 0))}%`;
      bar.style.width = `${percent(Math.max(newtons, 0)) - percent(Math.min(newtons, 0))}%`;
      words[side].textContent = thrust ? `${Math.round(newtons)} N` : "\u2013";
    });
  }
}

function eventLine({ time, name, severity, detail }) {
  const line = document.createElement("li");
  line.dataset.severity = severity;
  line.textContent = line.title = `${clock(time)} ${name.replaceAll("_", " ")}${detail ? `: ${detail}` : ""}`;
  return line;
}

export function clock(seconds) {
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${(seconds - 60 * minutes).toFixed(1).padStart(4, "0")}`;
}

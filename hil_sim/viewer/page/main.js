// Puts the page together: connection -> model -> chart, cards, watch, time.

import { Camera, Chart } from "./chart.js";
import { watchTheme } from "./draw.js";
import { Hands, keyControls } from "./hands.js";
import { Connection, Model, VERSION, bearing, clock, compass, distance } from "./model.js";
import { Panel } from "./panel.js";
import { Figures, Timeline } from "./time.js";
import { Watch } from "./watch.js";

const MARGIN_M = 6;
const RESULT_MS = 12000; // how long the result of a run lies over the chart
const ANSWER_MS = 6000;
const find = (id) => document.getElementById(id);
const boxes = [...document.querySelectorAll("#layers input")];

const model = new Model();
const camera = new Camera();
const shown = Object.fromEntries(boxes.map((box) => [box.name, box.checked]));
const chart = new Chart(find("chart"), camera, model, shown);
const watch = new Watch(model, { follow: toggleFollow, seek: (time) => timeline.seek(time) });
const panel = new Panel(find("vessels"), find("card"), model, { follow: toggleFollow, send: choosePlace, stop: askToStop });
const timeline = new Timeline(model, (request) => connection.ask(request));
const figures = new Figures(find("figures"), model, { seek: (time) => timeline.seek(time), limits: () => watch.limits });
const hands = new Hands(find("chart"), chart, {
  moved: () => chart.draw(),
  letGo: () => model.following && follow(null),
  pointed: showPlace,
  picked: askToSend,
});
chart.alarms = () => watch.pairs;
let fitted = false;
let wasLive = false;
let linked = linkedMoment();
let lostAt = null; // [s, ms] what was shown last, and when that was
let silence = null; // clears the notice

// ------------------------------------------------------------------------------- where to look

function follow(name) {
  model.following = name;
  document.body.dataset.following = name ?? "";
  if (!model.frame) return;
  refresh(true);
}

function toggleFollow(name) {
  follow(name === model.following ? null : name);
}

function fit() {
  follow(null);
  const { scene, names } = model.greeting;
  const places = model.vessels.flatMap(({ pose, goal }) => [pose, goal]).filter(Boolean);
  for (const name of model.isLive ? [] : names) {
    places.push(...(model.trails.get(name) ?? []).map(([, north, east]) => [north, east]));
  }
  // A run that is nowhere on the map, far from the origin, would be a dot beside it.
  const [mapNorth, mapEast] = scene.map_size_m ?? [-1, -1];
  const onMap = ([north, east]) => north >= 0 && north <= mapNorth && east >= 0 && east <= mapEast;
  fitted = places.length > 0;
  if (scene.map_size_m && (!fitted || places.some(onMap))) places.push([0, 0], scene.map_size_m);
  chart.fitCanvas();
  camera.fit(places, MARGIN_M);
  chart.draw();
}

function showPlace(place) {
  const output = find("place");
  output.hidden = !place || !model.greeting;
  if (output.hidden) return;
  const words = [`N ${place[0].toFixed(1)} m`, `E ${place[1].toFixed(1)} m`];
  const degrees = model.degrees(...place);
  if (degrees) words.push(`${degrees[0].toFixed(6)}\u00b0, ${degrees[1].toFixed(6)}\u00b0`);
  const from = model.followed ?? (model.vessels.length === 1 ? model.vessels[0] : null);
  if (from?.pose) {
    words.push(`${distance(from.pose, place).toFixed(1)} m ${compass(bearing(from.pose, place))} of ${from.name}`);
  }
  output.textContent = words.join("  ");
}

function refresh(always = false) {
  panel.update();
  watch.update(always);
  figures.update(always);
  timeline.update();
  chart.draw();
}

// --------------------------------------------------------------------------------- what is said

function say(words, { lasts = 0, command = "" } = {}) {
  clearTimeout(silence);
  find("notice").hidden = !words;
  find("notice-words").textContent = words;
  find("notice-command").hidden = !command;
  find("notice-command").querySelector("code").textContent = command;
  if (lasts) silence = setTimeout(() => say(""), lasts);
}

function sayLost() {
  if (!lostAt || document.body.dataset.connection === "open") return;
  const [time, since] = lostAt;
  const age = Math.round((performance.now() - since) / 1000);
  const again = model.greeting?.again ?? "";
  say(
    `The viewer is away. The chart shows ${clock(time)}, ${age} s ago. This page comes back by itself as soon as the ` +
      `viewer does${again ? "; if it was stopped, start it again (through ssh: look whether the tunnel stands):" : "."}`,
    { command: again },
  );
}

setInterval(sayLost, 1000);

function resultWords({ success, vessels }) {
  const count = vessels.filter(({ outcome }) => outcome === "goal").length;
  const nearest = Math.min(...vessels.map(({ closest_approach_m: gap }) => gap ?? Infinity));
  const near = Number.isFinite(nearest) ? `, nothing came nearer than ${Math.max(nearest, 0).toFixed(1)} m` : "";
  const failed = vessels.filter(({ outcome }) => outcome !== "goal").map(({ name, outcome }) => `${name}: ${outcome}`);
  if (success) return `${count > 1 ? `all ${count} ` : ""}arrived${near}`;
  return `${count} of ${vessels.length} arrived, ${failed.join(", ")}`;
}

// ---------------------------------------------------------------------------- links to a moment

// #t=12.3 (of a recording) or #at=1735689612.3 (since 1970), &follow=NAME&view=NORTH,EAST,SCALE
function linkedMoment() {
  const asked = new URLSearchParams(location.hash.slice(1));
  return asked.size ? asked : null;
}

function openLink() {
  if (!linked || !model.frame) return;
  const [asked, greeting] = [linked, model.greeting];
  const time = asked.has("at") ? Number(asked.get("at")) - greeting.begin_s : Number(asked.get("t") ?? NaN);
  if (model.isLive && asked.has("at")) return; // a moment of a run that goes on: kept for its replay
  linked = null;
  if (greeting.names.includes(asked.get("follow"))) follow(asked.get("follow"));
  const [north, east, scale] = (asked.get("view") ?? "").split(",").map(Number);
  if (scale > 0) {
    Object.assign(camera, { north, east, scale });
    fitted = true;
  }
  if (!model.isLive && Number.isFinite(time)) connection.ask({ playing: false, seek_s: time });
  chart.draw();
}

async function link() {
  if (!model.frame) return;
  const moment = model.isLive
    ? { at: (model.greeting.begin_s + model.time).toFixed(1) }
    : { t: model.time.toFixed(1) };
  const view = [camera.north.toFixed(1), camera.east.toFixed(1), camera.scale.toFixed(2)].join(",");
  const asked = new URLSearchParams({ ...moment, ...(model.following ? { follow: model.following } : {}), view });
  history.replaceState(null, "", `#${asked.toString().replaceAll("%2C", ",")}`);
  try {
    await navigator.clipboard.writeText(location.href);
    say("The link to this moment is copied, and stands in the address line.", { lasts: ANSWER_MS });
  } catch {
    say("The link to this moment stands in the address line.", { lasts: ANSWER_MS });
  }
}

addEventListener("hashchange", () => {
  linked = linkedMoment();
  openLink();
});

// -------------------------------------------------------------------------------------- orders

let ordered = null; // the vessel that a place is chosen for

function choosePlace(name) {
  ordered = name;
  hands.use("pick");
  say(`Choose on the chart where ${name} shall go. Esc: nowhere.`);
}

function askToSend(place) {
  const [name, from] = [ordered, model.vessel(ordered)?.pose];
  stopChoosing();
  chart.target = place;
  chart.draw();
  const way = from ? `, ${distance(from, place).toFixed(0)} m off, bearing ${compass(bearing(from, place))}` : "";
  confirmOrder(`Send ${name}?`, `To north ${place[0].toFixed(1)} m, east ${place[1].toFixed(1)} m${way}.`, `Send ${name}`, {
    vessel: name,
    goal: place.map((metres) => Number(metres.toFixed(2))),
  });
}

function askToStop(name) {
  confirmOrder(`Stop ${name}?`, "All its goals are taken back, its propellers come to rest. It drifts.", `Stop ${name}`, { vessel: name });
}

function stopChoosing() {
  ordered = null;
  hands.use("look");
  say("");
}

function confirmOrder(title, words, button, order) {
  const dialog = find("confirm");
  find("confirm-title").textContent = title;
  find("confirm-words").textContent = words;
  find("confirm-yes").textContent = button;
  dialog.returnValue = "";
  dialog.onclose = () => {
    chart.target = null;
    chart.draw();
    if (dialog.returnValue === "yes") connection.ask({ order });
  };
  dialog.showModal();
}

// ---------------------------------------------------------------------------------- the server

const connection = new Connection({
  state(state) {
    document.body.dataset.connection = state;
    find("connection").title = find("connection").textContent = state === "open" ? "connected" : "connection lost";
    if (state === "open") say("");
    else {
      lostAt ??= [model.time, performance.now()];
      sayLost();
    }
    if (state === "open") lostAt = null;
  },
  greeting(greeting) {
    if (greeting.version !== VERSION) {
      location.reload();
      return;
    }
    const isOver = wasLive && greeting.mode === "recording";
    wasLive = greeting.mode === "live";
    model.greet(greeting);
    const result = greeting.result ? resultWords(greeting.result) : "";
    find("mode").textContent = [greeting.mode === "live" ? "live" : "replay", greeting.scene.name].filter(Boolean).join(", ");
    find("result").textContent = result;
    find("result").dataset.success = String(greeting.result?.success ?? "");
    document.body.dataset.mode = greeting.mode;
    if (isOver) say(`The run is over: ${result}. This is its replay.`, { lasts: RESULT_MS });
    if (isOver && hands.tool === "pick") stopChoosing();
    panel.build();
    watch.build();
    timeline.build();
  },
  frame(frame) {
    model.take(frame);
    if (!fitted) fit();
    document.body.dataset.frames = String(Number(document.body.dataset.frames ?? 0) + 1);
    document.body.dataset.time = String(frame.time_s);
    refresh();
    openLink();
  },
  answer(words) {
    say(words, { lasts: ANSWER_MS });
    document.body.dataset.answer = words;
  },
});

const actions = {
  toggle: () => timeline.toggle(),
  step: (seconds) => timeline.step(seconds),
  fit,
  link,
  measure() {
    hands.use(hands.tool === "measure" ? "look" : "measure");
    find("measure").setAttribute("aria-pressed", String(hands.tool === "measure"));
  },
  acknowledge: () => watch.acknowledge(),
  zoom(factor) {
    camera.zoom(factor);
    chart.draw();
  },
  pan(right, down) {
    follow(null);
    camera.pan(right, down);
    chart.draw();
  },
  followNumber: (number) => model.greeting?.names[number - 1] && follow(model.greeting.names[number - 1]),
  escape() {
    if (hands.tool === "pick") stopChoosing();
    else if (hands.tool === "measure") actions.measure();
    else follow(null);
  },
  help: () => find("help").showModal(),
};

keyControls(actions);
find("zoom-in").addEventListener("click", () => actions.zoom(1.25));
find("zoom-out").addEventListener("click", () => actions.zoom(0.8));
find("fit").addEventListener("click", fit);
find("measure").addEventListener("click", actions.measure);
find("link").addEventListener("click", link);
find("help-button").addEventListener("click", actions.help);
find("copy").addEventListener("click", () => navigator.clipboard?.writeText(find("notice-command").querySelector("code").textContent));
find("notice-close").addEventListener("click", () => say(""));
find("layers-button").addEventListener("click", () => {
  const open = find("layers").classList.toggle("open");
  find("layers-button").setAttribute("aria-expanded", String(open));
});
for (const box of boxes) {
  box.addEventListener("change", () => {
    shown[box.name] = box.checked;
    chart.draw();
  });
}

const tabs = [...document.querySelectorAll("[role=tab]")];
function openTab(chosen) {
  for (const tab of tabs) {
    const open = tab === chosen;
    tab.setAttribute("aria-selected", String(open));
    tab.tabIndex = open ? 0 : -1;
    find(tab.getAttribute("aria-controls")).hidden = !open;
  }
  figures.update(true);
}
tabs.forEach((tab, i) => {
  tab.addEventListener("click", () => openTab(tab));
  tab.addEventListener("keydown", ({ key }) => {
    const next = { ArrowRight: 1, ArrowLeft: tabs.length - 1 }[key];
    if (!next) return;
    const other = tabs[(i + next) % tabs.length];
    openTab(other);
    other.focus();
  });
});

window.twinscrew = { model, chart, watch }; // to look into, from a browser's console
const wide = matchMedia("(min-width: 90rem)");
find("legend").open = wide.matches;
watchTheme(() => {
  panel.paint();
  timeline.marked = null;
  if (model.frame) refresh(true);
  chart.draw();
});

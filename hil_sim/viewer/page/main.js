// Puts the page together: connection -> model -> chart, panel, timeline.

import { Camera } from "./camera.js";
import { Chart } from "./chart.js";
import { Connection } from "./connection.js";
import { keyControls, pointerControls } from "./controls.js";
import { Model } from "./model.js";
import { Panel } from "./panel.js";
import { watchTheme } from "./theme.js";
import { Timeline } from "./timeline.js";
import { VERSION } from "./wire.js";

const MARGIN_M = 6;
const find = (id) => document.getElementById(id);
const boxes = [...document.querySelectorAll("#layers input")];

const model = new Model();
const camera = new Camera();
const shown = Object.fromEntries(boxes.map((box) => [box.name, box.checked]));
const chart = new Chart(find("chart"), camera, model, shown);
const panel = new Panel(find("vessels"), find("card"), model, (name) => follow(name === model.following ? null : name));
const timeline = new Timeline(model, (request) => connection.ask(request));
let fitted = false;

function follow(name) {
  model.following = name;
  document.body.dataset.following = name ?? "";
  panel.update();
  chart.draw();
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
  chart.measure();
  camera.fit(places, MARGIN_M);
  chart.draw();
}

function tell(words) {
  find("notice").hidden = !words;
  find("notice").textContent = words;
}

const connection = new Connection({
  state(state) {
    document.body.dataset.connection = state;
    find("connection").textContent = state === "open" ? "connected" : "connection lost, trying again";
    tell(state === "open" ? "" : "The server is away. The chart shows the last it said.");
  },
  greeting(greeting) {
    if (greeting.version !== VERSION) {
      location.reload();
      return;
    }
    model.greet(greeting);
    find("mode").textContent = [greeting.mode, greeting.scene.name].filter(Boolean).join(", ");
    panel.build();
    timeline.build();
  },
  frame(frame) {
    model.take(frame);
    if (!fitted) fit();
    document.body.dataset.frames = String(Number(document.body.dataset.frames ?? 0) + 1);
    document.body.dataset.time = String(frame.time_s);
    panel.update();
    timeline.update();
    chart.draw();
  },
});

const actions = {
  toggle: () => timeline.toggle(),
  step: (seconds) => timeline.step(seconds),
  fit,
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
  followNone: () => follow(null),
  help: () => find("help").showModal(),
};

pointerControls(find("chart"), camera, { moved: () => chart.draw(), letGo: () => model.following && follow(null) });
keyControls(actions);
find("zoom-in").addEventListener("click", () => actions.zoom(1.25));
find("zoom-out").addEventListener("click", () => actions.zoom(0.8));
find("fit").addEventListener("click", fit);
find("help-button").addEventListener("click", actions.help);
for (const box of boxes) {
  box.addEventListener("change", () => {
    shown[box.name] = box.checked;
    chart.draw();
  });
}
watchTheme(() => {
  panel.paint();
  chart.draw();
});

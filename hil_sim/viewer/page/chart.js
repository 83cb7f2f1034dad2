// Draws the chart, from the water up: one function a layer (layers.js, vessel.js).

import { colours, vesselColour } from "./theme.js";
import * as layers from "./layers.js";
import { drawVessel } from "./vessel.js";

export class Chart {
  constructor(canvas, camera, model, shown) {
    this.canvas = canvas;
    this.camera = camera;
    this.model = model;
    this.shown = shown; // which layers, { points: true, ... }
    this.waiting = false;
    new ResizeObserver(() => this.#resize()).observe(canvas);
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

  #resize() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
    Object.assign(this.camera, { width, height });
    this.draw();
  }

  #draw() {
    const { camera, model, shown } = this;
    const pen = this.canvas.getContext("2d");
    pen.fillStyle = colours.water;
    pen.fillRect(0, 0, camera.width, camera.height);
    layers.drawGrid(pen, camera);
    if (!model.greeting) return;
    const followed = model.followed;
    if (followed?.pose) camera.centre(followed.pose[0], followed.pose[1]);
    layers.drawScene(pen, camera, model.greeting.scene);
    for (const vessel of model.vessels) {
      const colour = vesselColour(model.index(vessel.name));
      const focus = !followed || followed === vessel;
      pen.globalAlpha = focus ? 1 : 0.35;
      if (shown.trails) layers.drawTrail(pen, camera, model.trail(vessel.name), colour);
      if (shown.zones && focus) layers.drawZones(pen, camera, vessel, model.greeting.zones, Boolean(followed));
      if (shown.goals) layers.drawGoal(pen, camera, vessel, model.greeting.goal_radius_m, colour);
      if (shown.objects) layers.drawObjects(pen, camera, vessel, colour);
      if (shown.tracks) layers.drawTracks(pen, camera, vessel, colour);
    }
    pen.globalAlpha = 1;
    for (const vessel of model.vessels) {
      drawVessel(pen, camera, vessel, model.greeting.hull, vesselColour(model.index(vessel.name)));
    }
    for (const vessel of shown.points ? model.vessels : []) {
      pen.globalAlpha = !followed || followed === vessel ? 1 : 0.35;
      layers.drawEchoes(pen, camera, vessel, vesselColour(model.index(vessel.name)));
    }
    pen.globalAlpha = 1;
    layers.drawScaleBar(pen, camera);
  }
}

// Draws the chart, from the water up: one function a layer (layers.js, vessel.js).

import { colours, vesselColour } from "./theme.js";
import * as layers from "./layers.js";
import { drawVessel } from "./vessel.js";
import { drawZones } from "./zones.js";

const FEW = 3; // so many vessels' details can be told apart
const PALE = 0.3;

export class Chart {
  constructor(canvas, camera, model, shown) {
    this.canvas = canvas;
    this.camera = camera;
    this.model = model;
    this.shown = shown; // which layers, { points: true, ... }
    this.waiting = false;
    new ResizeObserver(() => this.measure()).observe(canvas);
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
  measure() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
    Object.assign(this.camera, { width, height });
    this.draw();
  }

  #draw() {
    const { camera, model } = this;
    const pen = this.canvas.getContext("2d");
    pen.fillStyle = colours.water;
    pen.fillRect(0, 0, camera.width, camera.height);
    layers.drawGrid(pen, camera);
    if (!model.greeting) return;
    const { scene, hull } = model.greeting;
    const followed = model.followed;
    if (followed?.pose) camera.centre(followed.pose[0], followed.pose[1]);
    layers.drawScene(pen, camera, scene);
    this.#eachVessel((vessel, colour) => this.#drawBelow(pen, vessel, colour));
    for (const vessel of model.vessels) {
      drawVessel(pen, camera, vessel, hull, vesselColour(model.index(vessel.name)));
    }
    if (this.shown.points) {
      this.#eachVessel((vessel, colour) => layers.drawEchoes(pen, camera, vessel, colour));
    }
    layers.drawBuoys(pen, camera, scene);
    layers.drawScaleBar(pen, camera);
  }

  // What a vessel sees and wants. With many vessels, details are those of the followed one.
  #drawBelow(pen, vessel, colour) {
    const { camera, model, shown } = this;
    const isFollowed = model.followed === vessel;
    const detailed = isFollowed || (!model.followed && model.vessels.length <= FEW);
    if (shown.trails) layers.drawTrail(pen, camera, model.trail(vessel.name), colour);
    if (shown.zones && (isFollowed || !model.followed)) {
      drawZones(pen, camera, vessel, model.greeting.zones, isFollowed);
    }
    if (shown.goals) layers.drawGoal(pen, camera, vessel, model.greeting.goal_radius_m, colour);
    if (shown.objects && detailed) layers.drawObjects(pen, camera, vessel, colour);
    if (shown.tracks) layers.drawTracks(pen, camera, vessel, colour, detailed);
  }

  // Those that are not followed are paler, if one is.
  #eachVessel(draw) {
    const { followed } = this.model;
    const pen = this.canvas.getContext("2d");
    for (const vessel of this.model.vessels) {
      pen.globalAlpha = !followed || followed === vessel ? 1 : PALE;
      draw(vessel, vesselColour(this.model.index(vessel.name)));
    }
    pen.globalAlpha = 1;
  }
}

// Pause, and for a recording the slider and the speed.

import { clock } from "./panel.js";

export class Timeline {
  constructor(model, ask) {
    this.model = model;
    this.ask = ask;
    this.dragging = false;
    const find = (id) => document.getElementById(id);
    this.play = find("play");
    this.time = find("time");
    this.slider = find("slider");
    this.duration = find("duration");
    this.speed = find("speed");
    this.forRecordings = [this.slider, this.duration, find("speed-label")];
    this.play.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    this.slider.addEventListener("pointerdown", () => (this.dragging = true));
    this.slider.addEventListener("change", () => (this.dragging = false));
    this.speed.addEventListener("change", () => this.ask({ speed: Number(this.speed.value) }));
  }

  build() {
    const { duration_s: duration } = this.model.greeting;
    for (const element of this.forRecordings) element.hidden = this.model.isLive;
    this.slider.max = String(duration);
    this.duration.textContent = clock(duration);
    if (Number(this.speed.value) !== 1) this.ask({ speed: Number(this.speed.value) });
  }

  update() {
    const { time_s: time, playing } = this.model.frame;
    this.time.textContent = clock(time);
    if (!this.dragging) this.slider.value = String(time);
    this.slider.setAttribute("aria-valuetext", clock(time));
    this.play.textContent = playing ? "Pause" : "Play";
    this.play.setAttribute("aria-pressed", String(playing));
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

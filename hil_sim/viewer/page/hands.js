// Hands on the chart: mouse, touch and keys; the ruler, and the choice of a place.

const STEP_PX = 60;
const ZOOM = 1.25;
const WHEEL_PER_E = 600; // pixels of wheel for a factor of e
const NEAR_PX = 24; // an end of the ruler this near to a vessel is tied to it

export class Hands {
  // `on` has moved(), letGo() (the chart was dragged), pointed(place or null), picked(place).
  constructor(canvas, chart, on) {
    this.canvas = canvas;
    this.chart = chart;
    this.on = on;
    this.tool = "look"; // or "measure", "pick"
    this.fingers = new Map(); // pointer -> [x, y]
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerleave", () => on.pointed(null));
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.#up(event, end === "pointerup"));
    }
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        chart.camera.zoom(Math.exp(-event.deltaY / WHEEL_PER_E), event.offsetX, event.offsetY);
        on.moved();
      },
      { passive: false },
    );
  }

  use(tool) {
    this.tool = tool;
    this.canvas.dataset.tool = tool;
    if (tool === "look") this.chart.measure = null;
    this.on.moved();
  }

  #down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    const place = [event.offsetX, event.offsetY];
    this.fingers.set(event.pointerId, place);
    if (this.tool === "measure" && this.fingers.size === 1) {
      const end = this.#end(...place);
      this.chart.measure = [end, end];
      this.on.moved();
    }
  }

  #move(event) {
    const now = [event.offsetX, event.offsetY];
    this.on.pointed(this.chart.camera.place(...now));
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const others = [...this.fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    this.fingers.set(event.pointerId, now);
    const { camera } = this.chart;
    if (others.length) {
      camera.zoom(apart(now, others[0]) / Math.max(apart(before, others[0]), 1), ...others[0]);
    } else if (this.tool === "measure" && this.chart.measure) {
      this.chart.measure = [this.chart.measure[0], this.#end(...now)];
    } else if (this.tool !== "pick" && apart(now, before) > 0) {
      this.on.letGo();
      camera.pan(before[0] - now[0], before[1] - now[1]);
    }
    this.on.moved();
  }

  #up(event, meant) {
    const alone = this.fingers.size === 1;
    this.fingers.delete(event.pointerId);
    if (this.tool === "pick" && alone && meant) {
      this.on.picked(this.chart.camera.place(event.offsetX, event.offsetY));
    }
  }

  // An end of the ruler: the vessel under the pointer, or the place.
  #end(x, y) {
    const { camera, model } = this.chart;
    const under = ({ pose }) => pose && apart([camera.x(pose[1]), camera.y(pose[0])], [x, y]) < NEAR_PX;
    const vessel = model.vessels.find(under);
    return vessel ? { vessel: vessel.name } : { place: camera.place(x, y) };
  }
}

export function keyControls(actions) {
  const keys = {
    " ": () => actions.toggle(),
    a: () => actions.fit(),
    m: () => actions.measure(),
    k: () => actions.acknowledge(),
    l: () => actions.link(),
    "+": () => actions.zoom(ZOOM),
    "=": () => actions.zoom(ZOOM),
    "-": () => actions.zoom(1 / ZOOM),
    ArrowLeft: () => actions.pan(-STEP_PX, 0),
    ArrowRight: () => actions.pan(STEP_PX, 0),
    ArrowUp: () => actions.pan(0, -STEP_PX),
    ArrowDown: () => actions.pan(0, STEP_PX),
    ",": () => actions.step(-0.1),
    ".": () => actions.step(0.1),
    "[": () => actions.step(-5),
    "]": () => actions.step(5),
    Escape: () => actions.escape(),
    "?": () => actions.help(),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || hasOwnKeys(event.target, event.key)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = /^[1-9]$/.test(key) ? () => actions.followNumber(Number(key)) : keys[key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

// What has the focus may want the key itself: a slider its arrows, a button its space.
function hasOwnKeys(element, key) {
  if (element.closest("dialog") || element.tagName === "SELECT" || element.type === "number") return true;
  if (element.type === "range" || element.role === "tab") return key.startsWith("Arrow");
  return key === " " && ["BUTTON", "INPUT", "SUMMARY"].includes(element.tagName);
}

function apart([x0, y0], [x1, y1]) {
  return Math.hypot(x1 - x0, y1 - y0);
}

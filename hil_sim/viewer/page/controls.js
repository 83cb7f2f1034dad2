// Hands on the chart: mouse, touch and keys.

const STEP_PX = 60;
const ZOOM = 1.25;
const WHEEL_PER_E = 600; // pixels of wheel for a factor of e

export function pointerControls(canvas, camera, { moved, letGo }) {
  const fingers = new Map(); // pointer -> [x, y]
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.offsetX, event.offsetY];
    const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    fingers.set(event.pointerId, now);
    if (others.length) {
      camera.zoom(distance(now, others[0]) / Math.max(distance(before, others[0]), 1), ...others[0]);
    } else if (distance(now, before) > 0) {
      letGo();
      camera.pan(before[0] - now[0], before[1] - now[1]);
    }
    moved();
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(-event.deltaY / WHEEL_PER_E), event.offsetX, event.offsetY);
      moved();
    },
    { passive: false },
  );
}

export function keyControls(actions) {
  const keys = {
    " ": () => actions.toggle(),
    a: () => actions.fit(),
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
    Escape: () => actions.followNone(),
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
  if (element.closest("dialog") || element.tagName === "SELECT") return true;
  if (element.type === "range") return key.startsWith("Arrow");
  return key === " " && ["BUTTON", "INPUT"].includes(element.tagName);
}

function distance([x0, y0], [x1, y1]) {
  return Math.hypot(x1 - x0, y1 - y0);
}

// The style sheet's colours, for the canvas; read again when the system turns dark or light.

const NAMES = ["ink", "faint", "card", "water", "grid", "shore", "quay", "buoy", "danger", "caution", "fine"];
const VESSELS = 8;

export const colours = { vessels: [] };

export function watchTheme(changed) {
  const read = () => {
    const style = getComputedStyle(document.documentElement);
    for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
    colours.vessels = Array.from({ length: VESSELS }, (_, i) => style.getPropertyValue(`--v${i}`).trim());
    changed();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", read);
  read();
}

export function vesselColour(index) {
  return colours.vessels[index % VESSELS];
}

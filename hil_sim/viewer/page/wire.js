// Reads what the server sends; hil_sim/viewer/wire.py says how it is laid out.

export const VERSION = 1;

export function decodeFrame(buffer) {
  const headSize = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, headSize)));
  let at = 4 + headSize;
  for (const vessel of head.vessels) {
    const numbers = 2 * vessel.points;
    vessel.echoes = new Int16Array(buffer, at, numbers); // [cm] north, east of the vessel
    vessel.tracks = vessel.tracks.map(track);
    vessel.events = vessel.events.map(([time, name, severity, detail]) => ({ time, name, severity, detail }));
    at += 2 * numbers;
  }
  return head;
}

function track([id, north, east, vNorth, vEast, radius, unseen, situation]) {
  return { id, north, east, vNorth, vEast, radius, unseen, situation };
}

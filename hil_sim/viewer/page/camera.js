// Where one looks: a centre [m, north and east] and a scale [px/m]. North is up.

const SMALLEST = 0.2;
const LARGEST = 80;

export class Camera {
  constructor() {
    this.north = 0;
    this.east = 0;
    this.scale = 8;
    this.width = 1;
    this.height = 1;
  }

  x(east) {
    return this.width / 2 + (east - this.east) * this.scale;
  }

  y(north) {
    return this.height / 2 - (north - this.north) * this.scale;
  }

  centre(north, east) {
    this.north = north;
    this.east = east;
  }

  pan(right, down) {
    this.east += right / this.scale;
    this.north -= down / this.scale;
  }

  // Zooms so that what is under (x, y) stays there; without a place, the centre does.
  zoom(factor, x = this.width / 2, y = this.height / 2) {
    const scale = Math.min(Math.max(this.scale * factor, SMALLEST), LARGEST);
    const right = x - this.width / 2;
    const down = y - this.height / 2;
    this.east += right / this.scale - right / scale;
    this.north -= down / this.scale - down / scale;
    this.scale = scale;
  }

  // Shows all places, [[north, east], ...], with a margin [m] around.
  fit(places, margin) {
    if (!places.length) return;
    const norths = places.map(([north]) => north);
    const easts = places.map(([, east]) => east);
    const [south, north] = [Math.min(...norths) - margin, Math.max(...norths) + margin];
    const [west, east] = [Math.min(...easts) - margin, Math.max(...easts) + margin];
    this.centre((south + north) / 2, (west + east) / 2);
    this.scale = Math.min(this.width / (east - west), this.height / (north - south));
    this.scale = Math.min(Math.max(this.scale, SMALLEST), LARGEST);
  }
}

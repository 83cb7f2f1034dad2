// Shapes on the chart; `pen` is a canvas context in CSS pixels.

// A place ahead and to starboard [m] of another one, in pixels.
export function offset(camera, north, east, heading, ahead, starboard) {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  return [camera.x(east + s * ahead + c * starboard), camera.y(north + c * ahead - s * starboard)];
}

// A rectangle's corners in pixels.
export function rectangle(camera, north, east, heading, halfLength, halfWidth) {
  const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]];
  return corners.map(([a, b]) => offset(camera, north, east, heading, a * halfLength, b * halfWidth));
}

export function polygon(pen, corners) {
  pen.beginPath();
  for (const [x, y] of corners) pen.lineTo(x, y);
  pen.closePath();
}

export function circle(pen, camera, north, east, radius, leastPx) {
  pen.beginPath();
  pen.arc(camera.x(east), camera.y(north), Math.max(radius * camera.scale, leastPx), 0, 2 * Math.PI);
}

export function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

export function arrow(pen, x0, y0, x1, y1) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < 6) return;
  line(pen, x0, y0, x1, y1);
  const [dx, dy] = [(x1 - x0) / length, (y1 - y0) / length];
  polygon(pen, [[x1, y1], [x1 - 7 * dx + 3 * dy, y1 - 7 * dy - 3 * dx], [x1 - 7 * dx - 3 * dy, y1 - 7 * dy + 3 * dx]]);
  pen.fill();
}

export function text(pen, words, x, y, align = "left") {
  pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  pen.textAlign = align;
  pen.fillText(words, x, y);
}

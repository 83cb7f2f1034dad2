// The last latencies as a line; its top is the largest of them, at least 1 ms.

export function drawSparkline(canvas, values, colour) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  if (values.length < 2) return;
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  const top = Math.max(1, ...values);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.2;
  pen.lineJoin = "round";
  pen.beginPath();
  values.forEach((value, i) => {
    pen.lineTo((i / (values.length - 1)) * width, height - 1.5 - (value / top) * (height - 3));
  });
  pen.stroke();
}

// View, traces and scale bar. `plane.js` or `space.js` defines `HOME`, the initial view,
// `positionOf` a pose, `turn`, and `drawScene`.

// Centres of mass of the traced bodies at every sample.
const paths = Array.from(t, (_, i) => {
  const poses = posesOf(y.subarray(i * ny, (i + 1) * ny), t[i]);
  return run.traced.map((body) => positionOf(poses[body]));
});

const canvas = byId("stage");
const pen = canvas.getContext("2d");
const view = { ...HOME };
const [FILL, SURFACE, REACH] = [0.08, 0.4, 0.25]; // ink of what stands still, and of a field's reach
const GRID = 130; // CSS pixels between grid lines, at most; the scale bar is one step long
const MARKS = 30; // marks of more joints or bodies than this are smaller until the view comes closer
const WIDEST = 4 / 3; // a narrow window shows at least this much width for the camera's height

function scaleOfView() {
  const box = Math.min(canvas.clientHeight, canvas.clientWidth / WIDEST);
  return (box / run.camera.height) * view.zoom; // CSS pixels per metre
}

// Radius of a joint's mark and of a centre of mass, CSS pixels.
const markRadius = () => 3.6 * Math.min(1, (view.zoom * MARKS) / run.anchors.length);
const dotRadius = () => 2.2 * Math.min(1, (view.zoom * MARKS) / run.colors.length);

// The largest of 1, 2, 5 times a power of ten that does not exceed `length`.
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [5, 2, 1].find((digit) => digit * power <= length * 1.0000001);
}

function draw() {
  const where = place(clock.time);
  const state = stateAt(where);
  const poses = posesOf(state, clock.time);
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const scale = scaleOfView();

  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = run.camera.background;
  pen.fillRect(0, 0, width, height);
  drawScene(poses, where.low, { scale, ratio, width, height });
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawScaleBar(scale, height);
  showValues(state, where);
}

// Draw the paths of the traced bodies; `seen` maps a position to the picture.
function drawTraces(upTo, poses, pixel, seen) {
  pen.lineWidth = 1.3 * pixel;
  pen.lineJoin = "round";
  pen.globalAlpha = 0.5;
  run.traced.forEach((body, k) => {
    pen.strokeStyle = run.colors[body];
    pen.beginPath();
    for (let i = 0; i <= upTo; i++) pen.lineTo(...seen(paths[i][k]));
    pen.lineTo(...seen(positionOf(poses[body])));
    pen.stroke();
  });
  pen.globalAlpha = 1;
}

// Draw fixed balls, and obstacles of fields as outlines with their reach dotted; `size` is a metre in
// units of the pen, `pixel` a CSS pixel in units of the pen.
function drawBalls(size, pixel, seen) {
  pen.lineWidth = pixel;
  for (const { center, radius, reach } of run.balls ?? []) {
    const circle = (r, strength) => {
      pen.strokeStyle = `rgba(${ink}, ${strength})`;
      pen.beginPath();
      pen.arc(...seen(center), r * size, 0, 2 * Math.PI);
      pen.stroke();
    };
    circle(radius, SURFACE);
    if (reach === null) {
      pen.fillStyle = `rgba(${ink}, ${FILL})`;
      pen.fill();
    } else {
      pen.setLineDash([2 * pixel, 3 * pixel]);
      circle(radius + reach, REACH);
      pen.setLineDash([]);
    }
  }
}

function drawScaleBar(scale, height) {
  const length = roundLength(GRID / scale);
  const [left, base] = [16, height - 16];
  pen.strokeStyle = pen.fillStyle = `rgba(${ink}, 0.7)`;
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(left, base - 5);
  pen.lineTo(left, base);
  pen.lineTo(left + length * scale, base);
  pen.lineTo(left + length * scale, base - 5);
  pen.stroke();
  pen.font = "13px system-ui, sans-serif";
  pen.fillText(`${Number(length.toPrecision(1))} m`, left + 6, base - 6);
}

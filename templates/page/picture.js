// Draws the mechanism at a time. `bodyPoses(y, p)`, written by the generator, gives the poses of all
// bodies for any state, so that what moves here is the state itself and not a recorded film.

const byId = (id) => document.getElementById(id);
const run = JSON.parse(byId("run").textContent);

// Arrays lie in the page as base64 of little-endian float64, which is what browsers compute with.
function unpack(text) {
  return new Float64Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
}
const t = unpack(run.t);
const y = unpack(run.y);
const kinetic = unpack(run.kinetic);
const potential = unpack(run.potential);
const ny = run.states.length;
const last = t.length - 1;
const FALLBACK_COLOR = "#4477aa";
const colors = run.shapes.map((shapes) => (shapes.length ? shapes[0].color : FALLBACK_COLOR));

// ---- What holds at a time: linear between the two samples around it ----

function place(time) {
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  const span = t[high] - t[low];
  return { low, high, part: span > 0 ? Math.min(Math.max((time - t[low]) / span, 0), 1) : 0 };
}

function between(values, { low, high, part }, width = 1, column = 0) {
  const from = values[low * width + column];
  return from + part * (values[high * width + column] - from);
}

const stateAt = (where) => run.states.map((_, k) => between(y, where, ny, k));
const posesOf = (state) => bodyPoses(state, run.parameters);

// Centres of mass at every sample, for the trace.
const paths = Array.from(t, (_, i) => posesOf(y.subarray(i * ny, (i + 1) * ny)));

// ---- Picture ----

const canvas = byId("stage");
const pen = canvas.getContext("2d");
const view = { zoom: 1, x: 0, y: 0 };
const GRID = 130; // CSS pixels between grid lines, at most; the scale bar is one step long
const WIDEST = 4 / 3; // a narrow window shows at least this much width for the camera's height

function luminance(color) {
  const [r, g, b] = [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
const ink = luminance(run.camera.background) > 0.4 ? "0, 0, 0" : "255, 255, 255";

function scaleOfView() {
  const box = Math.min(canvas.clientHeight, canvas.clientWidth / WIDEST);
  return (box / run.camera.height) * view.zoom; // CSS pixels per metre
}

function centerOfView(poses) {
  const [x, y] = run.camera.follow === null ? run.camera.center : poses[run.camera.follow];
  return [x + view.x, y + view.y];
}

// The largest of 1, 2, 5 times a power of ten that does not exceed `length`.
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [5, 2, 1].find((digit) => digit * power <= length * 1.0000001);
}

function draw() {
  const where = place(clock.time);
  const state = stateAt(where);
  const poses = posesOf(state);
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const scale = scaleOfView();
  const [x, y] = centerOfView(poses);

  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.fillStyle = run.camera.background;
  pen.fillRect(0, 0, width, height);
  // From here on in metres, y up; `1 / scale` is one pixel.
  pen.setTransform(ratio * scale, 0, 0, -ratio * scale,
    ratio * (width / 2 - x * scale), ratio * (height / 2 + y * scale));
  drawGrid(x, y, width / scale / 2, height / scale / 2, 1 / scale);
  if (byId("trace").checked) drawTraces(where.low, poses, 1 / scale);
  poses.forEach((pose, body) => drawBody(body, pose, 1 / scale));
  for (const [body, ax, ay] of run.anchors) drawAnchor(poses[body], ax, ay, 1 / scale);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawScaleBar(scale, height);
  showValues(state, where);
}

function drawGrid(x, y, halfWidth, halfHeight, pixel) {
  const step = roundLength(GRID * pixel);
  pen.lineWidth = pixel;
  const line = (order, from, to) => {
    pen.strokeStyle = `rgba(${ink}, ${order === 0 ? 0.28 : 0.08})`;
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  };
  const [left, right, low, high] = [x - halfWidth, x + halfWidth, y - halfHeight, y + halfHeight];
  for (let i = Math.ceil(left / step); i * step <= right; i++) line(i, [i * step, low], [i * step, high]);
  for (let i = Math.ceil(low / step); i * step <= high; i++) line(i, [left, i * step], [right, i * step]);
}

function drawTraces(upTo, poses, pixel) {
  pen.lineWidth = 1.3 * pixel;
  pen.lineJoin = "round";
  pen.globalAlpha = 0.5;
  poses.forEach((pose, body) => {
    pen.strokeStyle = colors[body];
    pen.beginPath();
    for (let i = 0; i <= upTo; i++) pen.lineTo(paths[i][body][0], paths[i][body][1]);
    pen.lineTo(pose[0], pose[1]);
    pen.stroke();
  });
  pen.globalAlpha = 1;
}

function drawBody(body, [x, y, angle], pixel) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(angle);
  for (const shape of run.shapes[body]) drawShape(shape, pixel);
  pen.beginPath();
  pen.arc(0, 0, (run.shapes[body].length ? 2.2 : 6) * pixel, 0, 2 * Math.PI);
  pen.fillStyle = run.shapes[body].length ? `rgba(${ink}, 0.55)` : colors[body];
  pen.fill();
  pen.restore();
}

function drawShape(shape, pixel) {
  pen.fillStyle = shape.color;
  pen.beginPath();
  if (shape.type === "rod") {
    pen.lineCap = "round";
    pen.moveTo(...shape.start);
    pen.lineTo(...shape.end);
    // Its edge is a wider line below it.
    for (const [width, color] of [[pixel, `rgba(${ink}, 0.35)`], [-pixel, shape.color]]) {
      pen.lineWidth = Math.max(shape.width + width, pixel);
      pen.strokeStyle = color;
      pen.stroke();
    }
    return;
  }
  pen.save();
  if (shape.type === "disc") {
    pen.arc(...shape.center, shape.radius, 0, 2 * Math.PI);
  } else if (shape.type === "box") {
    const [width, height] = shape.size;
    pen.translate(...shape.center);
    pen.rotate(shape.angle);
    pen.rect(-width / 2, -height / 2, width, height);
  } else {
    for (const point of shape.points) pen.lineTo(...point);
    pen.closePath();
  }
  pen.fill();
  pen.lineWidth = pixel;
  pen.strokeStyle = `rgba(${ink}, 0.35)`;
  pen.stroke();
  if (shape.type === "disc") {
    // A spoke, for a disc without one would not be seen turning.
    pen.beginPath();
    pen.moveTo(...shape.center);
    pen.lineTo(shape.center[0] + shape.radius, shape.center[1]);
    pen.stroke();
  }
  pen.restore();
}

function drawAnchor([x, y, angle], ax, ay, pixel) {
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  pen.beginPath();
  pen.arc(x + cos * ax - sin * ay, y + sin * ax + cos * ay, 3.6 * pixel, 0, 2 * Math.PI);
  pen.fillStyle = run.camera.background;
  pen.strokeStyle = `rgba(${ink}, 0.8)`;
  pen.lineWidth = 1.6 * pixel;
  pen.fill();
  pen.stroke();
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

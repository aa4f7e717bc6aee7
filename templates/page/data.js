// What the page knows: the run, and its state and poses at any time. `bodyPoses(y, p, t)`, written
// by the generator, gives the poses of all bodies for any state and time, so that what moves here is
// the state itself and not a recorded film.

const byId = (id) => document.getElementById(id);
const run = JSON.parse(byId("run").textContent);

// Arrays lie in the page as base64 of little-endian float64, which is what browsers compute with.
const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const unpack = (text) => new Float64Array(bytesOf(text));
const t = unpack(run.t);
const y = unpack(run.y);
const kinetic = unpack(run.kinetic);
const potential = unpack(run.potential);
const ny = run.states.length;
const last = t.length - 1;

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

function stateAt(where) {
  const state = run.states.map((_, k) => between(y, where, ny, k));
  for (const four of run.quaternions ?? []) {
    const length = Math.hypot(...four.map((k) => state[k])) || 1;
    for (const k of four) state[k] /= length; // what lies between two unit quaternions is none
  }
  return state;
}
const posesOf = (state, time) => bodyPoses(state, run.parameters, time);

// What is read well on the background.
function luminance(color) {
  const [r, g, b] = [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
const ink = luminance(run.camera.background) > 0.4 ? "0, 0, 0" : "255, 255, 255";

// The data of the run, and the state and poses at any time. The generated `bodyPoses(y, p, t)`
// computes the poses of all bodies from state and time, so that no poses are stored.

const byId = (id) => document.getElementById(id);
const run = JSON.parse(byId("run").textContent);

// Arrays are stored as base64 of little-endian float64.
const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
const unpack = (text) => new Float64Array(bytesOf(text));
const t = unpack(run.t);
const y = unpack(run.y);
const kinetic = unpack(run.kinetic);
const potential = unpack(run.potential);
const ny = run.states.length;
const last = t.length - 1;

// ---- Values at a time, by linear interpolation between the two samples around it ----

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
    for (const k of four) state[k] /= length; // interpolation changes the length of a quaternion
  }
  return state;
}
const posesOf = (state, time) => bodyPoses(state, run.parameters, time);

// Ink that contrasts with the background.
function luminance(color) {
  const [r, g, b] = [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
const ink = luminance(run.camera.background) > 0.4 ? "0, 0, 0" : "255, 255, 255";

// Shows values, plays the run, and handles keys and pointers.

// ---- Numbers ----

function inWords(value) {
  const size = Math.abs(value);
  if (size >= 1e5 || (size > 0 && size < 1e-4)) return value.toExponential(3).replace("-", "−");
  return value.toFixed(4).replace("-", "−");
}

function row(table, name, unit, color) {
  const line = byId(table).tBodies[0].insertRow();
  const head = line.appendChild(document.createElement("th"));
  head.scope = "row";
  if (color) {
    const swatch = head.appendChild(document.createElement("span"));
    swatch.className = "swatch";
    swatch.style.background = color;
  }
  head.append(name);
  const value = line.insertCell();
  const last = line.insertCell();
  last.className = "unit";
  last.textContent = unit;
  return value;
}

const timeCell = row("values", "t", "s");
const stateCells = run.states.map((name, k) => row("values", name, run.units[k]));
const energyCells = ["kinetic", "potential", "total"].map((name) =>
  row("energies", name, "J", `var(--${name})`));

// Tables with more values than this are updated only a few times a second while the run plays, to
// save time for drawing.
const RUNNING = 40;
const PAUSE = 150; // ms

function showValues(state, where) {
  const now = performance.now();
  if (!clock.playing || state.length <= RUNNING || now - clock.shown > PAUSE) {
    clock.shown = now;
    state.forEach((value, k) => { stateCells[k].textContent = inWords(value); });
  }
  timeCell.textContent = inWords(clock.time);
  const [T, V] = [between(kinetic, where), between(potential, where)];
  [T, V, T + V].forEach((value, k) => { energyCells[k].textContent = inWords(value); });
  slider.value = clock.time;
  slider.setAttribute("aria-valuetext", `${clock.time.toFixed(2)} s`);
  const across = 1000 * share(clock.time);
  cursor.setAttribute("x1", across);
  cursor.setAttribute("x2", across);
}

// ---- Energy strip ----

const strip = byId("strip");
const duration = t[last] - t[0];
const share = (time) => (duration > 0 ? (time - t[0]) / duration : 0);

function svgChild(kind, attributes) {
  const child = strip.appendChild(document.createElementNS(strip.namespaceURI, kind));
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
  return child;
}

function drawStrip() {
  const curves = { potential, kinetic, total: kinetic.map((T, i) => T + potential[i]) };
  let [low, high] = [Infinity, -Infinity];
  for (const values of Object.values(curves)) {
    for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  }
  const span = high - low || 1;
  for (const [name, values] of Object.entries(curves)) {
    const points = Array.from(values, (value, i) =>
      `${(1000 * share(t[i])).toFixed(1)},${(96 - (92 * (value - low)) / span).toFixed(2)}`);
    svgChild("polyline", { points: points.join(" "), style: `stroke: var(--${name})` });
  }
  byId("lowest").textContent = `lowest ${inWords(low)} J`;
  byId("highest").textContent = `highest ${inWords(high)} J`;
  return svgChild("line", { y1: 0, y2: 100 });
}
const cursor = drawStrip();

// ---- Time ----

const clock = { time: t[0], playing: false, stamp: 0, shown: 0 };
const slider = byId("time");
slider.min = t[0];
slider.max = t[last];

function goTo(time) {
  setPlaying(false);
  clock.time = Math.min(Math.max(time, t[0]), t[last]);
  requestAnimationFrame(draw);
}

function setPlaying(playing) {
  if (playing && clock.time >= t[last]) clock.time = t[0];
  const starts = playing && !clock.playing;
  clock.playing = playing;
  clock.stamp = performance.now();
  byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  if (starts) requestAnimationFrame(tick);
}

function tick(now) {
  if (!clock.playing) return;
  // A page that was hidden continues where it was.
  const passed = Math.min(Math.max((now - clock.stamp) / 1000, 0), 0.1);
  clock.stamp = now;
  clock.time += passed * Number(byId("speed").value);
  if (clock.time >= t[last]) {
    if (byId("loop").checked && duration > 0) clock.time = t[0] + ((clock.time - t[0]) % duration);
    else {
      clock.time = t[last];
      setPlaying(false);
    }
  }
  draw();
  if (clock.playing) requestAnimationFrame(tick);
}

function step(direction) {
  // Several samples may have the same time, as at an impact; each step goes to another time.
  if (direction > 0) goTo(t.find((time) => time > clock.time) ?? t[last]);
  else goTo(t.findLast((time) => time < clock.time) ?? t[0]);
}

// ---- Keys and pointers ----

function zoom(factor, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) {
  const before = 1 / scaleOfView();
  view.zoom = Math.min(Math.max(view.zoom * factor, 0.01), 1000);
  const gained = before - 1 / scaleOfView();
  // The point under the pointer stays under it.
  view.x += (x - canvas.clientWidth / 2) * gained;
  view.y -= (y - canvas.clientHeight / 2) * gained;
  requestAnimationFrame(draw);
}

function move(dx, dy) {
  view.x -= dx / scaleOfView();
  view.y += dy / scaleOfView();
  requestAnimationFrame(draw);
}

function resetView() {
  Object.assign(view, HOME);
  requestAnimationFrame(draw);
}

function scrub(event) {
  const box = strip.getBoundingClientRect();
  goTo(t[0] + (duration * (event.clientX - box.left)) / box.width);
}

byId("play").addEventListener("click", () => setPlaying(!clock.playing));
byId("back").addEventListener("click", () => step(-1));
byId("forth").addEventListener("click", () => step(1));
byId("closer").addEventListener("click", () => zoom(1.25));
byId("farther").addEventListener("click", () => zoom(0.8));
byId("reset").addEventListener("click", resetView);
byId("trace").addEventListener("change", () => requestAnimationFrame(draw));
slider.addEventListener("input", () => goTo(Number(slider.value)));
strip.addEventListener("pointerdown", (event) => {
  strip.setPointerCapture(event.pointerId);
  scrub(event);
});
strip.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  if (!event.buttons) return;
  const turns = turn && event.buttons === 1 && !event.shiftKey;
  (turns ? turn : move)(event.movementX, event.movementY);
});
if (turn) canvas.addEventListener("contextmenu", (event) => event.preventDefault()); // it moves too
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
}, { passive: false });

const keys = {
  " ": () => setPlaying(!clock.playing),
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  Home: () => goTo(t[0]),
  End: () => goTo(t[last]),
  "+": () => zoom(1.25),
  "=": () => zoom(1.25),
  "-": () => zoom(0.8),
  0: resetView,
};
if (turn) {
  Object.assign(keys, {
    a: () => move(40, 0),
    d: () => move(-40, 0),
    w: () => move(0, 40),
    s: () => move(0, -40),
    1: () => lookFrom(-90, 0),
    2: () => lookFrom(0, 0),
    3: () => lookFrom(-90, 90),
  });
}
const shifted = turn ?? move;
const shiftKeys = {
  ArrowLeft: () => shifted(40, 0),
  ArrowRight: () => shifted(-40, 0),
  ArrowUp: () => shifted(0, 40),
  ArrowDown: () => shifted(0, -40),
};
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("select")) return;
  // On a button, a check box or a summary, space has its usual meaning.
  if (event.key === " " && event.target.closest("button, summary, input[type=checkbox]")) return;
  const action = (event.shiftKey && shiftKeys[event.key]) || keys[event.key];
  if (!action) return;
  event.preventDefault();
  action();
});

new ResizeObserver(draw).observe(canvas);
if (!matchMedia("(prefers-reduced-motion: reduce)").matches) setPlaying(true);

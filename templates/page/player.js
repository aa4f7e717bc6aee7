// The page itself: replays the recorded run or integrates a live motion, and wires the controls.

const player = (() => {
  const { byId } = tools;
  const LONGEST = 0.1; // s; a page that was hidden goes on where it was
  const [BUDGET, SHARE] = [24, 0.5]; // ms of each picture that steps may take, or a part of it
  const WARM = 250; // times 8 ms before a live motion
  const canvas = byId("stage");
  const stage = makeStage(canvas, mechanism);
  const replay = makeReplay(mechanism);
  // Go on from where a state has a value.
  const place = (index, value) => begin((y) => engine.lead(y, index, value));
  const values = makeValues(place);
  const slider = byId("time");
  const engine = DATA.live ? makeEngine(mechanism, DATA) : null;
  const clock = {
    mode: replay ? "replay" : "live",
    time: replay ? replay.begin : 0, // of the replay
    playing: false,
    stamp: 0, // of the last picture, ms
    seen: null, // what was, while the plots lead back in a live motion
    remark: "", // of the engine, as it is shown
    frames: [], // times of the last pictures
  };
  const show = makeShows(mechanism, () => redraw());
  const isLive = () => clock.mode === "live";
  let waiting = false; // for the next picture
  const poses = engine && makePoses(mechanism, place);
  const equations = makeEquations(makeTerms(mechanism, DATA), light);

  // ---- What is shown: a time, a state, parameters and inputs ----

  function current() {
    if (clock.seen) return clock.seen;
    if (isLive()) return { t: engine.t, y: engine.y, p: engine.p, u: engine.u };
    return { t: clock.time, y: replay.stateAt(clock.time), p: replay.p, u: replay.u };
  }

  // How far the kept run is from a state; nothing for null.
  function tellDifference(state) {
    const line = byId("difference");
    line.hidden = !state;
    if (!state) return;
    const { energy, body, distance, scale } = comparison.difference(state);
    line.textContent = `B (${comparison.told(engine)}): energy ${numbers.text(energy, "J", scale)} more, ${body} ${numbers.text(distance, "m", DATA.size)} away`;
  }

  // Keep the present run as B, which goes on beside; or drop it.
  function keep() {
    if (comparison.engine) comparison.drop();
    else comparison.keep(engine, engine.y, engine.t);
    showKept();
  }
  function showKept() {
    const isOn = Boolean(comparison.engine);
    byId("keep").setAttribute("aria-pressed", String(isOn));
    byId("keep").textContent = isOn ? "Drop B" : "Keep as B";
    plotting.compare(isOn ? comparison.samples : null);
    redraw();
  }

  // The time derivative of a state that is shown; null where the force of a held contact, which it contains, is not known.
  function ratesOf(state) {
    if (isLive() && !clock.seen) return Float64Array.from(engine.rates());
    const held = clock.seen ? clock.seen.held : replay.heldAt(state.t);
    return held ? null : Float64Array.from(mechanism.derivative(state.t, state.y, state.p, state.u));
  }

  // Light the arrows and the terms of an effect up; null for none.
  function light(effect) {
    show.lit = effect;
    equations.light(effect);
    redraw();
  }

  function energyOf({ t, y, p, u }) {
    const of = (name) => (mechanism[name] ? mechanism[name](t, y, p, u) : NaN);
    return { kinetic: of("kineticEnergy"), potential: of("potentialEnergy") };
  }

  function draw() {
    waiting = false;
    try {
      const state = current();
      const grip = isLive() && engine.grip;
      const pull = grip && grip.point ? [grip.point, grip.target] : null;
      const other = isLive() ? comparison.given(state.t) : null;
      stage.draw(state.t, state.y, state.p, state.u, show, { pull, keep: isLive(), other });
      tellDifference(other && state);
      values.show({
        ...state,
        energy: energyOf(state),
        playing: clock.playing,
        stepCost: isLive() ? engine.cost() : NaN,
        single: !isLive() && DATA.run.single,
      });
      poses?.show(state.y, clock.playing);
      equations?.show(state, () => ratesOf(state), clock.playing);
      overlay.draw(state.t);
      plotting.cursor(state.t);
      if (!isLive()) {
        slider.value = clock.time;
        slider.setAttribute("aria-valuetext", `${clock.time.toFixed(2)} s`);
      }
      byId("clock").textContent = `${state.t.toFixed(2)} s`;
    } catch (error) {
      say(`${error.message}`);
    }
    clock.frames.push(performance.now());
    if (clock.frames.length > 60) clock.frames.shift();
  }

  const redraw = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(draw);
  };

  // One sentence above the picture; none hides it.
  function say(text) {
    byId("message").textContent = text;
    byId("message").hidden = !text;
  }

  // ---- Time ----

  function tick(now) {
    if (!clock.playing) return;
    const before = clock.stamp;
    const passed = Math.min(Math.max((now - before) / 1000, 0), LONGEST) * Number(byId("speed").value);
    clock.stamp = now;
    if (isLive()) advance(passed, Math.max(BUDGET, SHARE * (now - before)));
    else {
      clock.time += passed;
      if (clock.time >= replay.end) {
        const length = replay.end - replay.begin;
        if (byId("loop").checked && length > 0) clock.time = replay.begin + ((clock.time - replay.begin) % length);
        else {
          clock.time = replay.end;
          setPlaying(false);
        }
      }
    }
    draw();
    if (clock.playing) requestAnimationFrame(tick);
  }

  function advance(seconds, budget) {
    const most = Math.min(budget, 1000 * LONGEST) / (comparison.engine ? 2 : 1);
    const isLate = !comparison.follow(engine.t, most);
    if (!isLate) engine.advance(seconds, most);
    byId("behind").hidden = !(engine.behind || isLate);
    afterSteps();
  }

  function afterSteps() {
    if (engine.remark !== clock.remark) {
      clock.remark = engine.remark;
      panels.showMethods(engine);
      byId("remark").textContent = engine.remark;
      byId("remark").hidden = !engine.remark;
    }
    if (!engine.error) return;
    say(`The motion stopped at t = ${numbers.text(engine.t, "s")}: ${engine.error}. Reset, or change the step or the method.`);
    setPlaying(false);
  }

  function setPlaying(playing) {
    if (playing && !isLive() && clock.time >= replay.end) clock.time = replay.begin;
    const starts = playing && !clock.playing;
    if (playing) clock.seen = null;
    else byId("behind").hidden = true;
    clock.playing = playing;
    clock.stamp = performance.now();
    byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    if (starts) requestAnimationFrame(tick);
  }

  // In a live motion the plots lead back to what was; it goes on from where it is.
  function seek(time) {
    if (!isLive()) {
      goTo(time);
      return;
    }
    setPlaying(false);
    clock.seen = plotting.rowAt(time);
    redraw();
  }

  function goTo(time) {
    if (isLive()) return;
    setPlaying(false);
    clock.time = Math.min(Math.max(time, replay.begin), replay.end);
    redraw();
  }

  function step(direction) {
    setPlaying(false);
    if (!isLive()) goTo(replay.neighbour(clock.time, direction));
    else if (direction > 0) {
      clock.seen = null;
      engine.step();
      comparison.follow(engine.t, Infinity);
      afterSteps();
    }
    redraw();
  }

  function reset() {
    if (!isLive()) {
      goTo(replay.begin);
      return;
    }
    engine.reset();
    comparison.restart();
    afterSteps();
    clock.seen = null;
    say("");
    values.restart();
    stage.fit();
    restartPlots();
  }

  // Traces and plots from the present state on.
  function restartPlots() {
    stage.clearTraces();
    plotting.restart();
    engine.onSample?.(engine.t, engine.y);
    redraw();
  }

  // ---- Replay and live ----

  function loadReplay() {
    const given = (i) => [replay.t[i], replay.row(i), replay.p, replay.u];
    stage.loadTraces(replay.t, given);
    const every = Math.max(1, Math.floor(replay.rows / 60));
    stage.calibrate(Array.from({ length: Math.ceil(replay.rows / every) }, (_, k) => given(k * every)));
  }

  function setMode(mode) {
    if (mode === "replay" && !replay) return;
    if (mode === "live" && !DATA.live) return;
    clock.mode = mode;
    clock.seen = null;
    document.body.dataset.mode = mode;
    for (const name of ["replay", "live"]) byId(`mode-${name}`).setAttribute("aria-pressed", String(mode === name));
    say("");
    if (mode === "replay") pointer?.letGo();
    values.restart();
    stage.clearTraces();
    if (mode === "replay") loadReplay();
    plotting.source(mode);
    redraw();
  }

  // What is changed by hand is seen in a live motion, which goes on from the picture.
  function goLive() {
    if (isLive() || !DATA.live) return isLive();
    const { t, y } = current();
    const from = Float64Array.from(y);
    setMode("live");
    engine.reset(from, t);
    if (engine.error) say(engine.error);
    setPlaying(true);
    return true;
  }

  // A live motion that stands at another state: the nearest one that constraints allow.
  function begin(change, t = null) {
    const now = current();
    const y = Float64Array.from(now.y);
    if (!isLive()) setMode("live");
    setPlaying(false);
    clock.seen = null;
    try {
      change(y);
    } catch (error) {
      say(`${error.message}`);
      return;
    }
    engine.reset(y, t ?? now.t, true);
    say(engine.error ?? "");
    values.restart();
    restartPlots();
  }

  const panels = makePanels({
    parameter(index, value) {
      if (!goLive()) return;
      engine.p[index] = value;
      recover();
    },
    input(index, value) {
      if (!goLive()) return;
      engine.u[index] = value;
      recover();
    },
    method(name, dt) {
      if (!goLive()) return;
      engine.setMethod(name, dt);
      recover();
    },
  });

  // A change may mend what stopped the motion.
  function recover() {
    if (engine.error) {
      const { t, y } = engine;
      engine.reset(Float64Array.from(y), t);
    }
    say(engine.error ?? "");
    values.restart();
    redraw();
  }

  const pointer = makePointer(canvas, stage, {
    canPull: () => DATA.live,
    pull(grip, target) {
      if (!goLive()) return;
      engine.pull(grip.body, grip.at, target.slice(0, DATA.dimensions));
      if (!clock.playing && !engine.error) setPlaying(true);
    },
    release() {
      engine?.release();
      values.restart();
      redraw();
    },
    light: (effect) => equations && light(show.lit === effect ? null : effect),
    redraw,
  });

  // ---- Wiring ----

  const overlay = makeOverlay(stage, show);
  const plotting = makePlotting({ mechanism, replay, seek, put: engine && place });
  const comparison = makeComparison(mechanism, DATA, plotting.channels);

  byId("theme").addEventListener("click", () => {
    const { dataset } = document.documentElement;
    const prefersDark = matchMedia("(prefers-color-scheme: dark)").matches;
    const isDark = dataset.theme ? dataset.theme === "dark" : prefersDark;
    dataset.theme = isDark ? "light" : "dark";
    repaint();
  });
  const repaint = () => {
    stage.setTheme();
    plotting.repaint();
    redraw();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);

  const zoom = (factor) => {
    stage.view.zoomBy(factor);
    redraw();
  };
  const view = (action) => () => {
    action();
    redraw();
  };
  const actions = {
    keep, play: () => setPlaying(!clock.playing), back: () => step(-1), forth: () => step(1), restart: reset,
    closer: () => zoom(1.25), farther: () => zoom(0.8), fit: view(stage.fit),
    "save-svg": () => downloads.saveText(`${downloads.fileName(DATA.name)}.svg`, stage.toSvg(), "image/svg+xml"),
    "mode-replay": () => setMode("replay"), "mode-live": () => { if (!isLive()) { setMode("live"); restartPlots(); setPlaying(true); } },
  };
  for (const [id, action] of Object.entries(actions)) byId(id).addEventListener("click", action);
  slider.addEventListener("input", () => goTo(Number(slider.value)));
  if (replay) {
    slider.min = replay.begin;
    slider.max = replay.end;
  }
  byId("keep").hidden = !DATA.live;
  byId("save-svg").hidden = Boolean(stage.failed);
  listenToPrinting(stage, plotting.plots);
  listenToKeys({ canvas, stage, setPlaying, step, goTo, reset, zoom, redraw, pointer, clock, replay, isLive });
  byId("modes").hidden = !DATA.live || !replay;
  const sharing = DATA.live ? makeSharing({ engine, panels, plotting, comparison, current, begin, setMode, showKept }) : null;
  say("");
  let warmed = 0;
  // While the run is replayed, the browser compiles the functions for the live motion.
  const warm = () => {
    if (isLive() || !window.requestIdleCallback) return;
    engine.warm(8);
    warmed += 1;
    if (warmed < WARM) requestIdleCallback(warm);
  };
  if (engine) {
    if (window.requestIdleCallback) requestIdleCallback(warm);
    engine.onSample = (t, y) => {
      stage.appendTraces([t, y, engine.p, engine.u]);
      plotting.append(engine);
    };
    panels.showMethods(engine);
  }
  if (stage.failed) {
    byId("no-picture").textContent = stage.failed;
    byId("no-picture").hidden = false;
  }
  setMode(clock.mode);
  new ResizeObserver(redraw).observe(canvas);
  if (!sharing?.open(location.hash) && !matchMedia("(prefers-reduced-motion: reduce)").matches && !location.hash.includes("still")) setPlaying(true);
  return { stage, clock, current, goTo, plotting, engine, show, comparison };
})();

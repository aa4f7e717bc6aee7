// `makeComparison`: a second live motion, B. It keeps the method, parameters and inputs that the first one had, and goes on beside it.
// Both have the engine's steps; where these end at other times, the state of B is a cubic between two of them.

const makeComparison = (mechanism, data, channels) => {
  const samples = makeSamples(channels);
  const { center } = tools;
  let [engine, before] = [null, null]; // the engine of B, and {t, y} before its last step

  // Keep a setup {p, u, method, dt}, from the state y at t on.
  function keep({ p, u, method, dt }, y, t) {
    engine = makeEngine(mechanism, data);
    engine.p.set(p);
    engine.u.set(u);
    engine.u.fill(0, data.pointer?.first ?? u.length); // only the first motion is pulled
    engine.setMethod(method, dt);
    engine.onSample = (time, state) => samples.append(time, state, engine.p, engine.u, channels.heldAfter?.(engine.events));
    restart(y, t);
  }

  function restart(y = null, t = 0) {
    if (!engine) return;
    engine.reset(y && Float64Array.from(y), t);
    before = { t: engine.t, y: engine.y.slice() };
    samples.clear();
  }

  // Go on to a time, for so many ms at most; whether it was reached.
  function follow(t, budget) {
    if (!engine) return true;
    const from = performance.now();
    while (!engine.error && engine.t < t - 1e-9 * engine.dt) {
      if (performance.now() - from > budget) return false;
      before = { t: engine.t, y: engine.y.slice() };
      engine.step();
    }
    return true;
  }

  // The state at a time that was reached.
  function stateAt(t) {
    const h = engine.t - before.t;
    if (t < before.t) return samples.rowAt(t)?.y ?? before.y;
    if (h <= 0 || t >= engine.t) return engine.y;
    const slopes = [before, engine].map((at) => Float64Array.from(mechanism.derivative(at.t, at.y, engine.p, engine.u)));
    const s = (t - before.t) / h;
    return before.y.map((y, k) => {
      const change = engine.y[k] - y;
      const bend = (h * slopes[0][k] - change) * (1 - s) - (h * slopes[1][k] - change) * s;
      return y + s * change + s * (1 - s) * bend;
    });
  }

  // What of B is not as in a setup, in words.
  function told({ p, u, method, dt }) {
    const parts = method === engine.method && dt === engine.dt ? [] : [`${engine.method}, ${numbers.short(1000 * engine.dt, "ms")}`];
    const list = (quantities, own, other) => quantities.forEach(({ name, unit }, k) => {
      if (own[k] !== other[k] && !name.includes("__")) parts.push(`${name} = ${numbers.short(own[k], unit)}`);
    });
    list(data.parameters, engine.p, p);
    list(data.inputs, engine.u, u);
    data.effects.forEach(({ name, switch: own }) => {
      if (own !== null && engine.p[own] !== p[own]) parts.push(`${engine.p[own] ? "with" : "without"} ${name}`);
    });
    return parts.join("; ") || "as this run";
  }

  // How far B is from a state: the difference of the energies, and the centres of mass that are farthest apart.
  function difference({ t, y, p, u }) {
    const other = [t, stateAt(t), engine.p, engine.u];
    const energy = (given) => mechanism.kineticEnergy(...given) + mechanism.potentialEnergy(...given);
    const poses = Float64Array.from(mechanism.bodyPoses(...other));
    const own = Float64Array.from(mechanism.bodyPoses(t, y, p, u));
    const away = data.bodies.map((_, k) => Math.hypot(...tools.subtract(center(poses, k), center(own, k))));
    const far = away.indexOf(Math.max(...away));
    return { energy: energy(other) - energy([t, y, p, u]), body: data.bodies[far], distance: away[far], scale: Math.abs(energy(other)) };
  }

  return {
    samples, keep, restart, follow, difference, told,
    drop: () => (engine = null),
    given: (t) => engine && [t, stateAt(t), engine.p, engine.u],
    get engine() { return engine; },
  };
};

// `makeEngine` integrates the mechanism in the page, by steps of equal length as `eomgen simulate`
// makes them. It needs no document. No function throws: what went wrong is the sentence `error`.

const makeEngine = (mechanism, data) => {
  const ny = data.states.length;
  const kinds = data.states.map((state) => state.kind);
  const positions = Int32Array.from([...kinds.keys()].filter((i) => kinds[i] === "position"));
  const others = Int32Array.from([...kinds.keys()].filter((i) => kinds[i] !== "position"));
  const quaternions = Int32Array.from((data.quaternions ?? []).flat());
  const sizes = { STATES: ny, POSITIONS: positions.length, OTHERS: others.length };
  const steps = makeSteps({ ...sizes, ORDERS: 25, ...mechanism.series?.sizes });
  const defaults = (table) => Float64Array.from(table, (x) => x.value);
  const space = data.dimensions === 3;
  const PULL = 20; // rate at which a pulled point follows the pointer, rad/s
  const LIFTED = 0.3; // part of the whole mass that a pull moves at least as quickly
  const STRONG = 30; // acceleration that the strongest pull gives the whole mass at least, m/s²
  const [SAFE, FASTEST] = [0.01, 1e3]; // margin of constraints, and greatest entry of states, to go back to
  const [MOST_LED, LED] = [200, 0.1]; // steps to a state that is given, and the greatest change of a coordinate in each
  const SHARE = 0.02; // part of the mean cost of a step that the last one has

  const all = [...methods, ...adaptive];
  const engine = {
    t: 0,
    y: new Float64Array(ny),
    p: defaults(data.parameters),
    u: defaults(data.inputs),
    methods: [],
    method: "",
    dt: 0.01,
    events: [],
    error: null,
    remark: "", // that another method goes on than the one it began with
    automatic: false, // whether the engine itself has chosen the method
    behind: false, // whether the last advance ran out of time
    grip: null, // what is pulled: {body, at, target, point, force}
    onSample: null,
  };
  let [start, goal, cost] = [0, 0, NaN];
  let regular = true;
  let [law, change] = [null, null];
  let safe = null; // the last state from which the mechanism moves on by itself

  // ---- The problem ----

  const derivative = (t, y) => {
    if (engine.grip) pullAt(t, y);
    return mechanism.derivative(t, y, engine.p, engine.u);
  };
  const given = () => [engine.p, engine.u];
  const ofStates = { positions, others, kinds, quaternions };
  const held = mechanism.projectPosition && makeLoops(mechanism, steps, data.size ?? 1, { ...ofStates, unit, given, derivative });
  const projected = held?.placed ?? ((t, y) => unit(y));
  const free = {
    ny,
    positions,
    others,
    steps,
    held,
    f: derivative,
    implicitStep: mechanism.implicitStep && ((t, y, h) => {
      if (engine.grip) pullAt(t, y);
      return mechanism.implicitStep(t, y, engine.p, engine.u, [h]);
    }),
    placed: projected,
    touches: Boolean(mechanism.contacts?.length),
    arguments: given,
    get series() { return engine.grip ? null : mechanism.series; },
    // A state like the first one, number k, to see what depends on what.
    sample(k) {
      const y = Float64Array.from(mechanism.initialState(engine.p));
      return held ? y : y.map((x, i) => x + 0.1 * Math.max(1, Math.abs(x)) * Math.sin((k + 1) * (i + 1)));
    },
    given: () => [engine.grip ? NaN : 0, ...engine.p, ...engine.u], // a pull is never as it was
    switching: mechanism.switchingFunctions && ((t, y) => mechanism.switchingFunctions(t, y, engine.p, engine.u)),
    angles: positions.filter((i) => data.states[i].unit === "rad"),
    unseen: (data.span ?? 10) / 1000,
    timed: mechanism.switchingFunctionsOfTime && ((t) => Array.from(mechanism.switchingFunctionsOfTime(t, engine.y, engine.p, engine.u))),
  };
  let problem = free;

  // ---- What samples ----

  const clocks = data.clocks && Object.fromEntries(Object.entries(data.clocks).map(([name, x]) => {
    const Numbers = ["periods", "lags"].includes(name) ? Float64Array : Int32Array;
    return [name, Array.isArray(x) ? Numbers.from(x) : x];
  }));
  if (clocks) {
    const [each, noise] = [() => new Float64Array(clocks.many), new Float64Array(clocks.noises)];
    Object.assign(clocks, { seeds: each(), made: each(), moved: each(), noise });
  }
  const nextSample = () => (clocks ? steps.next_tick(clocks) / clocks.per_second : Infinity);
  const sampled = {
    samples: (t, y, noise, values) => values.set(mechanism.samples(t, y, engine.p, engine.u, noise)),
  };
  // Make what is due by now.
  function makeSamples() {
    clocks.seeds.set(mechanism.seeds(engine.t, engine.y, engine.p, engine.u));
    while (nextSample() <= engine.t) steps.sample(sampled, clocks, engine.y);
    renew();
  }
  // What was due up to the present time is past; at the start of the mechanism's own motion it is made.
  function beginSamples(isStart) {
    const past = (period, lag) => {
      let count = Math.max(0, Math.floor((engine.t * clocks.per_second - lag) / period) - 1);
      while ((lag + count * period) / clocks.per_second <= engine.t) count += 1;
      return count;
    };
    for (let c = 0; c < clocks.many; c += 1) {
      clocks.made[c] = isStart ? 0 : past(clocks.periods[c], 0);
      clocks.moved[c] = isStart ? 0 : past(clocks.periods[c], clocks.lags[c]);
    }
    if (isStart) makeSamples();
  }

  function unit(y) {
    if (steps.normalised(quaternions.length / 4, quaternions, y)) return y;
    for (let i = 0; i < quaternions.length; i += 4) {
      const four = quaternions.subarray(i, i + 4);
      const length = Math.hypot(...Array.from(four, (k) => y[k]));
      if (Number.isFinite(length)) for (const k of four) y[k] /= length;
    }
    return y;
  }

  function suits(method) {
    try {
      return method.suits?.(free) ?? true;
    } catch {
      return false;
    }
  }

  function makeLaw() {
    const table = mechanism.contacts ?? [];
    if (!table.length) return null;
    const sizes = table.map((c) => (c.unit === "m" ? data.size ?? 1 : 1));
    const switches = table.map((c) => data.effects.find((e) => e.name === c.effect)?.switch ?? null);
    const at = (t, y) => [t, y, ...given()];
    return contacts.make({
      names: table.map((c) => c.name),
      sizes,
      states: ny,
      active: (k) => switches[k] === null || engine.p[switches[k]] !== 0,
      many: mechanism.held(...at(engine.t, engine.y), table.map(() => 0)).length,
      gaps: (t, y) => mechanism.gaps(...at(t, y)),
      rates: (t, y) => mechanism.gapRates(...at(t, y)),
      impact: (t, y, chosen) => mechanism.impact(...at(t, y), chosen),
      held: (t, y, forces) => {
        if (engine.grip) pullAt(t, y);
        return mechanism.held(...at(t, y), forces);
      },
      restSpeed: data.restSpeed ?? null,
      span: data.span ?? 10,
    }, engine.y);
  }

  const way = contactWay({
    states: ny,
    change: (t, y, h) => change(problem, t, y, h),
    dense: (t, y, end) => (change.free ? change(problem, t, y, end) : null),
    placed: projected,
    added: steps.add_compensated,
  });

  // ---- Steps ----

  // The next mark after t: steps end at start + i dt.
  const mark = () => start + (Math.floor((engine.t - start) / engine.dt + 1e-9) + 1) * engine.dt;

  // Go on from the present state: steps end at the same marks, sums begin anew.
  function renew() {
    way.part();
    regular = engine.t === start;
    problem = law?.held().length ? { ...free, f: law.derivative, series: null } : free;
  }

  function restart() {
    start = engine.t;
    goal = engine.t;
    if (law) note(law.begin(engine.t));
    renew();
  }

  const isSafe = () => !(held?.margin <= SAFE) && engine.y.every((x) => Math.abs(x) < FASTEST);

  // The chosen method failed: go on by the adaptive one, if it was not the user who chose.
  function helped(error) {
    if (engine.grip && mechanism.projectPosition) {
      // Pulled to where the loops do not move on: let go before, at rest.
      engine.release();
      if (safe) engine.y.set(safe);
      engine.remark = `let go at ${Number(engine.t.toPrecision(4))} s, where the loops do not move on`;
      for (const i of others) if (kinds[i] === "velocity") engine.y[i] = 0;
      start = engine.t;
      renew();
      return;
    }
    if (!engine.automatic || engine.method === "DOP853") throw error;
    if (safe && !isSafe()) engine.y.set(safe); // steps had become unstable
    engine.remark = `${engine.method} fails at ${Number(engine.t.toPrecision(4))} s, DOP853 goes on`;
    engine.method = "DOP853";
    change = all.find((m) => m.name === "DOP853").make(free);
    engine.dt = Math.max(engine.dt, 0.005);
    start = engine.t;
    renew();
  }

  // One step to the next mark, or to the contact that comes first.
  function makeStep() {
    const { t, y } = engine;
    const off = law ? law.release(t) : [];
    if (off.length) {
      note(off);
      renew();
    }
    const [whole, due] = [mark(), nextSample()];
    const end = due <= whole + 1e-9 * engine.dt ? due : whole;
    const isWhole = Math.abs(whole - end) <= 1e-9 * engine.dt;
    regular &&= isWhole;
    if (!way.go(t, y, regular ? engine.dt : end - t, end)) {
      throw new Error("the state overflows or is not a number: take a smaller step");
    }
    if (law) {
      const events = law.ended(way, t, end, (there) => (engine.t = there));
      if (events) {
        note(events);
        renew();
        return;
      }
    } else {
      engine.t = end;
      y.set(way.last);
    }
    if (end === due) makeSamples();
    regular = isWhole;
    if (engine.onSample) engine.onSample(engine.t, engine.y);
  }

  const note = (events) => engine.events.push(...events);

  function guarded(action) {
    if (engine.error) return 0;
    try {
      action();
      return 1;
    } catch (error) {
      engine.error = `${error.message}`;
      return 0;
    }
  }

  function timed(action) {
    const from = performance.now();
    action();
    const took = performance.now() - from;
    cost = Number.isNaN(cost) ? took : cost + SHARE * (took - cost);
  }

  function toMark() {
    const end = mark();
    try {
      while (engine.t < end - 1e-9 * engine.dt) makeStep();
      if (isSafe()) safe = engine.y.slice();
    } catch (error) {
      helped(error);
    }
  }

  // Advance by so many seconds, in whole steps; stop after `budget` ms, and then do not catch up.
  engine.advance = (seconds, budget = Infinity) => {
    goal = Math.max(goal, engine.t) + seconds;
    const from = performance.now();
    let made = 0;
    engine.behind = false;
    while (!engine.error && mark() <= goal + 1e-9 * engine.dt) {
      made += guarded(() => timed(toMark));
      if (performance.now() - from > budget) {
        engine.behind = mark() <= goal;
        goal = engine.t;
        break;
      }
    }
    return made;
  };
  engine.step = () => {
    const made = guarded(() => timed(toMark));
    goal = engine.t;
    return made;
  };

  engine.setMethod = (name, dt = engine.dt) => {
    const method = all.find((m) => m.name === name);
    if (!method || !engine.methods.some((m) => m.name === name)) {
      engine.error = `the method ${name} does not suit this mechanism`;
      return;
    }
    if (!(dt > 0 && Number.isFinite(dt))) {
      engine.error = "the step is not a positive number of seconds";
      return;
    }
    engine.error = null;
    engine.automatic = false;
    engine.method = name;
    engine.dt = dt;
    cost = NaN;
    change = method.make(free);
    start = goal = engine.t;
    guarded(renew);
  };
  // Begin again from a state, by default the initial one; `given` by hand, from the nearest one that is possible.
  engine.reset = (y = null, t = 0, given = false) => {
    engine.error = null;
    engine.release();
    safe = null;
    engine.events.length = 0;
    guarded(() => {
      engine.t = t;
      engine.y.set(y ?? data.initial ?? mechanism.initialState(engine.p));
      if (given) projected(t, engine.y);
      change = all.find((m) => m.name === engine.method).make(free);
      law = makeLaw();
      restart();
      if (clocks) beginSamples(y === null && t === 0);
    });
  };
  // Give state k a value. Loops take the other coordinates along: the state goes there in the directions that they allow.
  engine.lead = (y, k, value) => {
    const velocities = Array.from(others).filter((i) => kinds[i] === "velocity");
    const place = quaternions.length ? -1 : positions.indexOf(k);
    const speeds = velocities.map((i) => y[i]);
    if (held && kinds[k] === "velocity") {
      velocities.forEach((i) => (y[i] = Number(i === k)));
      projected(engine.t, y);
      const factor = (value - speeds[velocities.indexOf(k)]) / y[k];
      velocities.forEach((i, j) => (y[i] = speeds[j] + (Number.isFinite(factor) ? factor * y[i] : 0)));
      return;
    }
    if (!held || place < 0) {
      y[k] = value;
      return;
    }
    for (let count = 0; count < MOST_LED; count += 1) {
      velocities.forEach((i, j) => (y[i] = Number(j === place)));
      projected(engine.t, y);
      const way = velocities.map((i) => y[i]);
      const step = (value - y[k]) / way[place];
      const most = LED / Math.max(...way.map(Math.abs));
      if (!Number.isFinite(step) || Math.abs(value - y[k]) <= 1e-12 * (1 + Math.abs(value))) break;
      positions.forEach((i, j) => (y[i] += Math.max(-most, Math.min(most, step)) * way[j]));
    }
    velocities.forEach((i, j) => (y[i] = speeds[j]));
    projected(engine.t, y);
  };
  engine.cost = () => cost;
  // The time derivative of the present state, under what is held and pulled too.
  engine.rates = () => problem.f(engine.t, engine.y);
  // Call the derivative for so many ms, so that the browser compiles it; ms of the fastest call.
  engine.warm = (budget) => {
    const until = performance.now() + budget;
    let least = Infinity;
    guarded(() => {
      for (let from = performance.now(); from < until; ) {
        mechanism.derivative(engine.t, engine.y, engine.p, engine.u);
        const now = performance.now();
        least = Math.min(least, now - from);
        from = now;
      }
    });
    return least;
  };
  engine.energy = () => {
    const of = (name) => mechanism[name](engine.t, engine.y, engine.p, engine.u);
    try {
      return { kinetic: of("kineticEnergy"), potential: of("potentialEnergy") };
    } catch {
      return { kinetic: NaN, potential: NaN };
    }
  };

  // ---- The pointer: a critically damped spring to a point of a body ----

  const inputs = data.pointer ?? { first: data.inputs.length, perBody: 0 };
  const rotated = (pose, at) => (space
    ? [0, 4, 8].map((row) => pose[row] * at[0] + pose[row + 1] * at[1] + pose[row + 2] * at[2])
    : [Math.cos(pose[2]) * at[0] - Math.sin(pose[2]) * at[1], Math.sin(pose[2]) * at[0] + Math.cos(pose[2]) * at[1]]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

  // The arm from the centre of mass, the point and its velocity, in world axes.
  function pointOf(body, at, t, y) {
    const [n, m] = space ? [12, 6] : [3, 3];
    const pose = mechanism.bodyPoses(t, y, engine.p, engine.u).subarray(n * body, n * body + n);
    const arm = rotated(pose, at);
    const center = space ? [pose[3], pose[7], pose[11]] : [pose[0], pose[1]];
    const speed = mechanism.bodyVelocities(t, y, engine.p, engine.u).subarray(m * body, m * body + m);
    const turning = space ? cross(speed.subarray(3), arm) : [-speed[2] * arm[1], speed[2] * arm[0]];
    return {
      arm,
      point: center.map((x, i) => x + arm[i]),
      velocity: center.map((_, i) => speed[i] + turning[i]),
    };
  }

  function press(body, arm, force) {
    const torque = space ? cross(arm, force) : [arm[0] * force[1] - arm[1] * force[0]];
    [...force, ...torque].forEach((x, i) => (engine.u[inputs.first + inputs.perBody * body + i] = x));
  }

  function pullAt(t, y) {
    const { body, at, target, stiffness, damping, strongest } = engine.grip;
    const { arm, point, velocity } = pointOf(body, at, t, y);
    const force = point.map((x, i) => stiffness * (target[i] - x) - damping * velocity[i]);
    const size = Math.hypot(...force);
    const factor = size > strongest ? strongest / size : 1;
    engine.grip.point = point;
    engine.grip.force = force.map((x) => x * factor);
    press(body, arm, engine.grip.force);
  }

  // The mass that a point of a body seems to have: how a unit force accelerates it, along all axes.
  function massAt(body, at) {
    const { t, y } = engine;
    const { arm, velocity } = pointOf(body, at, t, y);
    const rest = Float64Array.from(mechanism.derivative(t, y, engine.p, engine.u));
    let mobility = 0;
    for (let axis = 0; axis < data.dimensions; axis += 1) {
      press(body, arm, velocity.map((_, i) => (i === axis ? 1 : 0)));
      const slope = mechanism.derivative(t, y, engine.p, engine.u);
      const faster = y.map((x, k) => (kinds[k] === "position" ? x : x + slope[k] - rest[k]));
      mobility += pointOf(body, at, t, faster).velocity[axis] - velocity[axis];
    }
    press(body, arm, velocity.map(() => 0));
    return data.dimensions / mobility;
  }

  // Pull the point `at` of a body, from its centre of mass in its axes, to `target` in the world, m.
  engine.pull = (body, at, target) => guarded(() => {
    const { grip } = engine;
    if (!grip || grip.body !== body || grip.at.some((x, i) => x !== at[i])) {
      engine.release();
      const mass = massAt(body, at);
      if (!(mass > 0 && Number.isFinite(mass))) return;
      // So strong that what hangs on a light body is lifted, but stable for explicit methods.
      const moved = Math.max(mass, LIFTED * (data.mass ?? 0));
      const most = /implicit|gauss/.test(engine.method) ? Infinity : 0.5 * mass / engine.dt;
      const damping = Math.min(2 * moved * PULL, most);
      const stiffness = Math.min(moved * PULL ** 2, most * 0.5 / engine.dt);
      const size = data.drawing?.size ?? data.size ?? 1;
      const strongest = Math.max(stiffness * size, STRONG * (data.mass ?? 0));
      engine.grip = { body, at: [...at], stiffness, damping, strongest };
    }
    engine.grip.target = [...target];
    pullAt(engine.t, engine.y);
  });
  engine.release = () => {
    if (!engine.grip) return;
    const first = inputs.first + inputs.perBody * engine.grip.body;
    engine.u.fill(0, first, first + inputs.perBody);
    engine.grip = null;
  };

  // ---- What it starts with ----

  // The scene's own method, or one that keeps energy; where forces have corners, as of contacts, and
  // where loops are kept closed, an explicit one. The step is a part of that which an adaptive method took.
  function choice() {
    const { name, step } = data.integrator ?? {};
    const own = step && engine.methods.find((m) => m.name === name);
    if (own) return [name, step];
    const corners = mechanism.switchingFunctions || mechanism.contacts?.length || mechanism.projectPosition;
    const keeping = engine.methods.some((m) => m.name === "leapfrog") ? "leapfrog" : "implicit_midpoint";
    const most = Math.min(Math.max((data.meanStep ?? 0.01) / (corners ? 2 : 6), 1e-4), 0.01);
    const power = 10 ** Math.floor(Math.log10(most) + 1e-9);
    const digit = [5, 2, 1].find((x) => x * power <= most * 1.0001) ?? 1;
    return [corners ? "rk4" : keeping, Number((digit * power).toPrecision(1))];
  }
  engine.methods = all.filter(suits).map(({ name, about }) => ({ name, about }));
  const [method, step] = choice();
  engine.setMethod(data.liveMethod ?? method, data.liveStep ?? step);
  engine.automatic = !data.liveMethod;
  engine.reset();
  return engine;
};

// `adaptive`: methods whose steps are as long as a tolerance allows, whatever the page's own are: a state
// between their ends is that of their interpolant. They are `free`: `change(problem, t, y, end)` returns the
// state at `end`, in an array that the next call may reuse.
//
// problem: as for `methods`, with placed(t, y), which puts a state on the constraints; given(), the numbers
// on which the motion depends beside its state; switching(t, y), the functions that are 0 where the derivative
// has corners, if there are some; angles, the states that are; unseen, the longest step along which these functions
// need not be followed; and whether there are pulses in time, which no long step may pass.

const adaptive = (() => {
  const [RTOL, ATOL] = [1e-9, 1e-12];
  const MOST = 100000; // steps within one of the page's
  const ROOM = 32; // for zeros in a step

  // The numbers and arrays of a record: `floats` and `wholes` by name, each of its size.
  const roomy = (numbers, floats, wholes = {}) => {
    const made = { ...numbers };
    for (const name of Object.keys(floats)) made[name] = new Float64Array(floats[name]);
    for (const name of Object.keys(wholes)) made[name] = new Int32Array(wholes[name]);
    return made;
  };

  const dormandPrince = (ny) => {
    const { first_length, made_many_DOP853, interpolate_DOP853, within, ...steps } = makeSteps(ny);
    const { passed_over, end_at, UNUSUAL, MOST_PARTS } = steps;
    const run = { atol: new Float64Array(ny).fill(ATOL), rtol: RTOL, longest: Infinity, until: Infinity, dense: 1, reaches: 1 };
    const place = new Float64Array(ny);
    let [path, of, given, next] = [[], null, [], 0];
    let [watch, found, step] = [null, null, null];
    const system = { derivative: (t, y, out) => out.set(of.f(t, y)) };
    const checks = {
      begins: () => {},
      are_usual: (k, first, past) => k.subarray(first * ny, past * ny).every(Number.isFinite),
      placed: (t, y) => of.placed(t, y).every(Number.isFinite),
      seen: (at, y, raw, last, k, terms) => {
        step = { at, y, raw, k, terms };
        found.many = 0;
        return passed_over(watch, found, along, run, {}, at.t, at.end, y, last, 1) ? UNUSUAL : 0;
      },
      keeps: (at) => {
        end_at(watch, at.end);
        found.last = found.now;
        return 1;
      },
    };
    const along = {
      states_at: (n, times, to) => {
        interpolate_DOP853(system, step.at, step.y, step.raw, step.k, step.terms);
        for (let i = 0; i < n; i += 1) within(step.at, step.y, step.terms, times[i], to.subarray(i * ny));
      },
      switching_at: (t, y, to) => to.set(of.switching(t, y)),
      slope_at: system.derivative,
    };
    const watching = (many) => {
      const numbers = { many, timed: 1, turning: of.angles.length, angles: of.angles, most: MOST_PARTS, room: ROOM };
      const parts = { marks: MOST_PARTS, starts: MOST_PARTS, ends: MOST_PARTS, values: 5 * MOST_PARTS * many };
      const brackets = { opens: ROOM, closes: ROOM, moments: 3, places: 3 * ny };
      const unknown = { earlier: NaN, here: NaN, marked: 0 };
      const floats = { before: many, first: many, last: many, ...parts, ...brackets };
      return roomy({ ...numbers, ...unknown }, floats, { asked: MOST_PARTS * many, which: ROOM });
    };
    const record = () => {
      const floats = { ends: 1, lengths: 1, states: ny, slopes: ny, losses: ny, terms: 7 * ny, times: 0, rows: 0 };
      return roomy({ count: 0, most: 1 }, floats, { derivatives: 1, sampled: 1 });
    };
    // A step goes from `at.t` and `y`, with the slope there and what rounding took, to the end of `to`.
    const begin = (t, y) => {
      const to = record();
      to.ends[0] = t;
      to.states.set(y);
      system.derivative(t, y, to.slopes);
      next = first_length(system, run, t, to.states, to.slopes, run.longest);
      if (next === Infinity) next = 1; // without states
      watch = watching(of.switching ? of.switching(t, y).length : 0);
      found = roomy({ last: -Infinity, unseen: of.unseen, room: ROOM }, { times: ROOM, slopes: 3 * ny });
      run.until = Infinity;
      path = [{ at: { t, end: t, h: 0 }, y: to.states, to }];
    };
    const go = () => {
      const { at: { end }, to } = path.at(-1);
      if (end >= run.until) run.until = Infinity;
      const made = record();
      let at = null;
      for (let why = UNUSUAL; why; ) {
        at = { t: end, h: 0, end: 0, length: next, derivatives: 0, is_dense: 0, made: 0 };
        found.until = Infinity;
        why = made_many_DOP853(system, checks, run, at, to.states, to.slopes, to.losses, made);
        if (why && found.until === Infinity) {
          throw new Error("the steps become too small: the motion is not smooth here");
        }
        if (why) run.until = found.until; // it passed over a corner: it is repeated
      }
      next = at.length;
      path.push({ at: { ...at, t: end }, y: to.states, to: made });
    };
    // The state at a time of the path.
    const state = (t) => {
      const { at, y, to } = path.find((step) => t <= step.at.end);
      if (t === at.end) return to.states;
      within(at, y, to.terms, t, place);
      return of.placed(t, place);
    };
    const goesOn = (problem, t, y) => {
      const now = problem.given();
      const known = problem === of && now.length === given.length && now.every((x, i) => x === given[i]);
      [of, given] = [problem, now];
      run.longest = Infinity;
      if (!known || !path.length || !(path[0].at.t <= t && t <= path.at(-1).at.end)) return false;
      return state(t).every((x, k) => x === y[k]);
    };
    const change = (problem, t, y, end) => {
      if (!goesOn(problem, t, y)) begin(t, y);
      if (problem.pulses) run.longest = end - t;
      for (let count = 0; !(path.at(-1).at.end >= end); count += 1) {
        if (count === MOST) throw new Error("the steps become too small: the motion is not smooth here");
        go();
      }
      while (path.length > 1 && path[0].at.end < t) path.shift();
      return state(end);
    };
    return Object.assign(change, { free: true });
  };

  return [{ name: "DOP853", about: "Dormand-Prince 8(5,3), steps by tolerance", make: dormandPrince }];
})();

// `adaptive`: methods whose steps are as long as a tolerance allows, whatever the page's own are: a state
// between their ends is that of their interpolant. They are `free`: `change(problem, t, y, end)` returns the
// state at `end`, in an array that the next call may reuse.
//
// problem: as for `methods`, with placed(t, y), which puts a state on the constraints; given(), the numbers
// on which the motion depends beside its state; and whether it has corners, which no long step may pass.

const adaptive = (() => {
  const [RTOL, ATOL] = [1e-9, 1e-12];
  const MOST = 100000; // steps within one of the page's

  const dormandPrince = (ny) => {
    const { first_length, made_many_DOP853, within } = makeSteps(ny);
    const run = { atol: new Float64Array(ny).fill(ATOL), rtol: RTOL, longest: Infinity, until: Infinity, dense: 1 };
    const [place, slope] = [0, 0].map(() => new Float64Array(ny));
    let [path, of, given, next] = [[], null, [], 0];
    const system = { derivative: (t, y, out) => out.set(of.f(t, y)) };
    const checks = {
      begins: () => {},
      are_usual: (k, first, past) => k.subarray(first * ny, past * ny).every(Number.isFinite),
      placed: (t, y) => of.placed(t, y).every(Number.isFinite),
      seen: () => 0,
      keeps: () => 1,
    };
    const record = () => {
      const room = { count: 0, most: 1, times: new Float64Array(0), rows: new Float64Array(0) };
      for (const name of ["ends", "lengths", "derivatives", "sampled"]) room[name] = new Float64Array(1);
      for (const name of ["states", "slopes", "losses"]) room[name] = new Float64Array(ny);
      return { ...room, terms: new Float64Array(7 * ny) };
    };
    // A step goes from `at.t` and `y`, with the slope there and what rounding took, to the end of `to`.
    const begin = (t, y) => {
      const to = record();
      to.ends[0] = t;
      to.states.set(y);
      system.derivative(t, y, to.slopes);
      next = first_length(system, run, t, to.states, to.slopes, run.longest);
      if (next === Infinity) next = 1; // without states
      path = [{ at: { t, end: t, h: 0 }, y: to.states, to }];
    };
    const go = () => {
      const { at: { end }, to } = path.at(-1);
      const at = { t: end, h: 0, end: 0, length: next, derivatives: 0, is_dense: 0, made: 0 };
      const made = record();
      if (made_many_DOP853(system, checks, run, at, to.states, to.slopes, to.losses, made) !== 0) {
        throw new Error("the steps become too small: the motion is not smooth here");
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
      if (problem.corners) run.longest = end - t;
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

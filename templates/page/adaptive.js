// `adaptive`: methods whose steps are as long as a tolerance allows, whatever the page's own are: a state
// between their ends is that of their interpolant. They are `free`: `change(problem, t, y, end)` returns the
// state at `end`, in an array that the next call may reuse.
//
// problem: as for `methods`, with placed(t, y), which puts a state on the constraints; given(), the numbers
// on which the motion depends beside its state; switching(t, y), the functions that are 0 where the derivative
// has corners, if there are some; angles, the states that are; unseen, the longest step along which these functions
// need not be followed; timed(t), those that are 0 where forces jump at given times, if there are some; and `series`, that of Taylor,
// or null where there is none, as while something is pulled.

const adaptive = (() => {
  const [RTOL, ATOL] = [1e-9, 1e-12];
  const MOST = 100000; // steps within one of the page's
  const MOST_AHEAD = 100; // steps of the page that one is long at most where forces jump at given times
  const SLOPES = 16; // of DOP853
  const numbers = (n) => new Float64Array(n);

  // Methods: what the engine is given of one; the length of a `first` step; `terms`, with which a step is known between its ends
  // after `expand`, and `place`, the state at a time in a step of which these are known.
  const dormandPrince = ({ ny, steps }, system, run) => {
    const [k, terms, slope] = [SLOPES * ny, 7 * ny, ny].map(numbers);
    return {
      terms,
      first(t, y) {
        system.derivative(t, y, slope);
        const length = steps.first_length(system, run, t, y, slope, run.longest);
        return length === Infinity ? 1 : length; // 1 without states
      },
      ready: () => k.set(slope),
      make: (_, at, y, lost, raw) => steps.explicit_step_DOP853(system, run, at, y, lost, k, raw),
      record: () => slope.set(k.subarray((steps.SLOPES_USED - 1) * ny, steps.SLOPES_USED * ny)),
      expand: (at, y, raw) => steps.interpolate_DOP853(system, at, y, raw, k, terms),
      place: (at, y, raw, known, t, to) => steps.within(at, y, known, t, to),
    };
  };
  const rosenbrock = (free, system, run) => {
    const { ny, steps, positions } = free;
    const terms = numbers(3 * ny);
    const rodas = steps.records.Rodas({ atol: run.atol, rtol: run.rtol, positions: positions.length, timed: 1, dense: terms });
    const factors = steps.records.Factors({ n: ny });
    let before = null;
    return {
      terms,
      first(t, y) {
        before = { h_last: 0, error: 1 };
        return dormandPrince(free, system, run).first(t, y);
      },
      ready: () => Object.assign(rodas, before, { longest: run.longest }),
      make(_, at, y, lost, raw) {
        rodas.lost = lost;
        return steps.rosenbrock_step(system, rodas, factors, run, at, y, raw);
      },
      record: () => (before = { h_last: rodas.h_last, error: rodas.error }),
      expand() {},
      place: (at, y, last, dense, t, to) => steps.rodas_within({ dense, last }, y, (t - at.t) / at.h, to),
    };
  };
  const taylor = (free, system, run) => {
    const { ny, steps, series } = free;
    const order = steps.order_of(RTOL);
    const [room, terms] = [steps.records.Terms({}), numbers((order + 1) * ny)];
    const fixed = series.fixed(...free.arguments()).slice();
    let here = NaN;
    const of = {
      started: (t, y, first, rates) => series.first(t, y, fixed, first, rates),
      extended: (k, ...given) => series.next(k, fixed, ...given),
      sums_of_products: steps.convolved,
    };
    return {
      terms,
      first: () => 0, // it follows from the series
      ready(_, at, y) {
        if (at.t === here) return; // it is known
        here = at.t;
        steps.expanded(of, at.t, y, order, room, terms);
        at.length = steps.reach(run, order, terms, y);
      },
      make(_, at, y, lost, raw) {
        steps.series_step(order, terms, run, at, y, lost, raw);
        return at.end > at.t;
      },
      record() {},
      expand() {},
      place(at, y, raw, rows, t, to) {
        steps.change_after(t - at.t, order, rows, to);
        for (let k = 0; k < ny; k += 1) to[k] = y[k] + to[k];
      },
    };
  };

  const make = (maker) => (free) => {
    const { ny, steps } = free;
    const run = steps.records.Bounds({ atol: numbers(ny).fill(ATOL), rtol: RTOL, longest: Infinity, until: Infinity, reaches: 1 });
    const [place, sizes] = [numbers(ny), numbers(ny).fill(1)];
    let [path, of, given, ahead] = [[], null, [], 0];
    let [method, watch, found, now] = [null, null, null, null];
    const [at, start] = [steps.records.Progress({}), steps.records.Start({})];
    const kept = steps.records.Records({ most: 1, count: 0, wide: 0 });
    const system = {
      derivative: (t, y, out) => out.set(of.f(t, y)),
      jacobian: (t, y, out) => steps.differences(system, sizes, t, y, out),
    };
    const along = {
      states_at(n, times, to) {
        const { y, raw } = now;
        method.expand(at, y, raw);
        for (let i = 0; i < n; i += 1) method.place(at, y, raw, method.terms, times[i], to.subarray(i * ny));
      },
      switching_at: (t, y, to) => to.set(of.switching(t, y)),
      slope_at: system.derivative,
    };
    // What the engine is given of checks of steps; those that are kept are put on the path.
    const checks = {
      begins() {},
      is_usual: () => true,
      placed: (t, y) => Boolean(of.placed(t, y)),
      seen(_, y, raw, last) {
        now = { y, raw };
        found.many = 0;
        if (!steps.passed_over(watch, found, along, run, {}, { start: at.t, end: at.end, first: y, last }, 1)) return steps.MADE;
        run.until = found.until; // it passed over a corner
        return steps.AGAIN;
      },
      keeps(i, _, last) {
        steps.end_at(watch, at.end);
        found.last = found.now;
        method.expand(at, now.y, now.raw);
        const [y, raw, terms] = [now.y, now.raw, method.terms].map((x) => x.slice());
        path.push({ t: at.t, h: at.h, end: at.end, length: at.length, y, raw, terms, last: last.slice() });
        return true;
      },
    };
    // What goes on from a time and state, of which no step before is known.
    const first = (t, y) => {
      const many = of.switching ? of.switching(t, y).length : 0;
      const watched = { many, timed: 1, turning: of.angles.length, angles: of.angles, most: steps.MOST_PARTS };
      watch = steps.records.Watch({ ...watched, room: steps.MOST_PARTS * many, earlier: NaN, here: NaN });
      found = steps.records.Switches({ last: -Infinity, unseen: of.unseen, room: steps.MOST_PARTS * many });
      run.until = Infinity;
      method = (maker === taylor && !of.series ? dormandPrince : maker)(free, system, run);
      Object.assign(at, { t, length: method.first(t, y) });
      start.state.set(y);
      path.push({ t, end: t, length: at.length, last: y.slice() });
    };
    // The last number before the derivative changes whatever the state is, and the next one; null if it does not within a
    // length. It is looked for at the ends of the page's own steps.
    const jump = (t, length) => {
      if (!of.timed) return null;
      const signs = (time) => of.timed(time).map((x) => x > 0).join();
      const before = signs(t);
      let [low, high] = [t, t + ahead];
      for (let k = 2; signs(high) === before; k += 1) {
        if (!(high < t + length)) return null;
        [low, high] = [high, t + k * ahead];
      }
      for (let middle = low + (high - low) / 2; low < middle && middle < high; middle = low + (high - low) / 2) {
        if (signs(middle) === before) low = middle;
        else high = middle;
      }
      return low > t ? { low, high } : null;
    };
    const go = () => {
      method.ready(run, at, start.state);
      const forced = jump(at.t, at.length);
      const why = steps.step_on(method, checks, run, at, start, kept, forced?.low ?? Infinity);
      if (why !== steps.MADE) throw new Error("the steps become too small: the motion is not smooth here");
      if (forced?.low === at.t) first(forced.high, start.state);
    };
    // The state at a time of the path.
    const state = (t) => {
      const step = path.find(({ end }) => t <= end);
      if (t === step.end) return step.last;
      method.place(step, step.y, step.raw, step.terms, t, place);
      return of.placed(t, place);
    };
    const goesOn = (problem, t, y) => {
      const now = problem.given();
      const known = problem === of && now.length === given.length && now.every((x, i) => x === given[i]);
      [of, given] = [problem, now];
      run.longest = Infinity;
      if (!known || !path.length || !(path[0].t <= t && t <= path.at(-1).end)) return false;
      return state(t).every((x, k) => x === y[k]);
    };
    const change = (problem, t, y, end) => {
      if (!goesOn(problem, t, y)) {
        path = [];
        start.lost.fill(0);
        first(t, y);
      }
      if (problem.timed) [ahead, run.longest] = [end - t, MOST_AHEAD * (end - t)];
      for (let count = 0; !(path.at(-1).end >= end); count += 1) {
        if (count === MOST) throw new Error("the steps become too small: the motion is not smooth here");
        go();
      }
      while (path.length > 1 && path[0].end < t) path.shift();
      return state(end);
    };
    return Object.assign(change, { free: true });
  };

  return [
    { name: "DOP853", about: "Dormand-Prince 8(5,3), steps by tolerance", make: make(dormandPrince) },
    { name: "taylor", about: "Taylor series, steps by tolerance", make: make(taylor), suits: ({ series }) => Boolean(series) },
    { name: "Rodas5P", about: "Rosenbrock method of order 5, steps by tolerance", make: make(rosenbrock) },
  ];
})();

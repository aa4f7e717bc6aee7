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
  const areFinite = (x) => x.every(Number.isFinite);

  // Methods. `first(t, y)` is what the first step needs beside its time and state; `made(now)` a step from the
  // end of another one, or null: its `end`, length h, the state there, `raw`, and what the next one needs;
  // `within(step, t, to)` the state at a time in it.
  const dormandPrince = ({ ny, steps }, system, run) => {
    const last = steps.SLOPES_USED - 1;
    return {
      first(t, y) {
        const slope = numbers(ny);
        system.derivative(t, y, slope);
        const length = steps.first_length(system, run, t, y, slope, run.longest);
        return { slope, length: length === Infinity ? 1 : length, lost: numbers(ny) }; // 1 without states
      },
      made({ end: t, last: y, slope, length, lost: before }) {
        const at = steps.records.Progress({ t, length });
        const [raw, k, terms] = [ny, SLOPES * ny, 7 * ny].map(numbers), lost = before.slice();
        k.set(slope);
        if (!steps.explicit_step_DOP853(system, run, at, y, lost, k, raw)) return null;
        steps.interpolate_DOP853(system, at, y, raw, k, terms);
        const next = k.slice(last * ny, (last + 1) * ny);
        return areFinite(k) ? { end: at.end, at, raw, terms, slope: next, length: at.length, lost } : null;
      },
      within: ({ at, y, terms }, t, to) => steps.within(at, y, terms, t, to),
    };
  };
  const rosenbrock = (free, system, run) => {
    const { ny, steps, positions } = free;
    const { first } = dormandPrince(free, system, run);
    const numbersOf = { atol: run.atol, rtol: run.rtol, positions: positions.length, timed: 1 };
    const [rodas, factors] = [steps.records.Rodas(numbersOf), steps.records.Factors({ n: ny })];
    return {
      first: (t, y) => ({ ...first(t, y), before: 0, error: 1 }),
      made({ end: t, last: y, length, before, error, lost }) {
        const dense = numbers(3 * ny);
        Object.assign(rodas, { t_bound: run.until, longest: run.longest, h_abs: length, h_last: before, error, dense });
        rodas.lost.set(lost);
        if (!steps.rodas_step(system, rodas, factors, t, y)) return null;
        const { end, h_last: h } = rodas;
        return { end, h, raw: rodas.last.slice(), dense, length: rodas.h_abs, before: h, error: rodas.error, lost: rodas.lost.slice() };
      },
      within: ({ t: start, h, y, raw, dense }, t, to) => steps.rodas_within({ dense, last: raw }, y, (t - start) / h, to),
    };
  };
  const taylor = (free, system, run) => {
    const { ny, steps, series } = free;
    const order = steps.order_of(RTOL);
    const room = steps.records.Terms({});
    const fixed = series.fixed(...free.arguments()).slice();
    const of = {
      started: (t, y, first, rates) => series.first(t, y, fixed, first, rates),
      extended: (k, ...given) => series.next(k, fixed, ...given),
      sums_of_products: steps.convolved,
    };
    return {
      first: () => ({ lost: numbers(ny) }),
      made({ end: t, last: y, lost: before }) {
        const [raw, rows] = [ny, (order + 1) * ny].map(numbers), lost = before.slice();
        const at = steps.records.Progress({ t });
        steps.expanded(of, t, y, order, room, rows);
        at.length = steps.reach(run, order, rows, y);
        steps.series_step(order, rows, run, at, y, lost, raw);
        const { end } = at;
        return end > t && areFinite(raw) ? { end, raw, rows, lost } : null;
      },
      within({ t: start, y, rows }, t, to) {
        steps.change_after(t - start, order, rows, to);
        for (let k = 0; k < ny; k += 1) to[k] = y[k] + to[k];
      },
    };
  };

  const make = (maker) => (free) => {
    const { ny, steps } = free;
    const run = steps.records.Bounds({ atol: numbers(ny).fill(ATOL), rtol: RTOL, longest: Infinity, until: Infinity });
    const [place, sizes] = [numbers(ny), numbers(ny).fill(1)];
    let [path, of, given, ahead] = [[], null, [], 0];
    let [method, watch, found, step] = [null, null, null, null];
    const system = {
      derivative: (t, y, out) => out.set(of.f(t, y)),
      jacobian: (t, y, out) => steps.differences(system, sizes, t, y, out),
    };
    const along = {
      states_at(n, times, to) {
        for (let i = 0; i < n; i += 1) method.within(step, times[i], to.subarray(i * ny));
      },
      switching_at: (t, y, to) => to.set(of.switching(t, y)),
      slope_at: system.derivative,
    };
    // What goes on from a time and state, of which no step before is known.
    const first = (t, y) => {
      const many = of.switching ? of.switching(t, y).length : 0;
      const watched = { many, timed: 1, turning: of.angles.length, angles: of.angles, most: steps.MOST_PARTS };
      watch = steps.records.Watch({ ...watched, room: steps.MOST_PARTS * many, earlier: NaN, here: NaN });
      found = steps.records.Switches({ last: -Infinity, unseen: of.unseen, room: steps.MOST_PARTS * many });
      run.until = Infinity;
      method = (maker === taylor && !of.series ? dormandPrince : maker)(free, system, run);
      return { t, end: t, last: y.slice(), ...method.first(t, y) };
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
      const now = path.at(-1);
      const { end: t, last: y } = now;
      const at = jump(t, now.length ?? run.longest);
      if (t >= run.until) run.until = Infinity;
      if (at) run.until = Math.min(run.until, at.low);
      for (;;) {
        const made = method.made(now);
        if (!made) throw new Error("the steps become too small: the motion is not smooth here");
        step = { t, y, ...made };
        step.last = of.placed(step.end, step.raw.slice());
        Object.assign(found, { until: Infinity, many: 0 });
        if (!steps.passed_over(watch, found, along, run, {}, { start: t, end: step.end, first: y, last: step.last }, 1)) break;
        run.until = found.until; // it passed over a corner: it is repeated
      }
      steps.end_at(watch, step.end);
      found.last = found.now;
      path.push(step);
      if (at?.low === step.end) path.push({ ...first(at.high, step.last), lost: step.lost });
    };
    // The state at a time of the path.
    const state = (t) => {
      const step = path.find(({ end }) => t <= end);
      if (t === step.end) return step.last;
      method.within(step, t, place);
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
      if (!goesOn(problem, t, y)) path = [first(t, y)];
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

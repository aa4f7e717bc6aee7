// `contacts`: rigid contacts and stops. They strike, rest, are held by forces that only push, and lift:
// the algorithms and tolerances of `eomgen.run.events`, `contacts` and `complementarity`, for steps of
// equal length. Gaps, their rates and accelerations are relative to `sizes`.

const contacts = (() => {
  const TOLERANCE = 1e-9;
  const STILL = 3e-11;
  const PARTING = 1e-10;
  const ALPHA = 10 / Math.sqrt(9.81);
  const RISE = 5e-8;
  const AWAY = 1e-6;
  const STRONG = 2 ** 400;
  const BOUNCES = 100;
  const STRIKES = 5000;
  const TOGETHER = 1e-9;
  const largest = (values) => values.reduce((most, x) => Math.max(most, Math.abs(x)), 0);

  // f with 0 <= f, 0 <= a = matrix f + offset, f_i a_i = 0; null if none is found.
  function complementary(matrix, offset) {
    const forces = new Float64Array(offset.length);
    return makeSteps(0).complementary(offset.length, Float64Array.from(matrix.flat()), Float64Array.from(offset), forces)
      ? Array.from(forces) : null;
  }

  const dot = (a, b) => a.reduce((total, x, i) => total + x * b[i], 0);

  // A zero between a and b of a function with these values there.
  function root(of, a, b, atA, atB, xtol, rtol) {
    const steps = makeSteps(0);
    const search = { xtol, rtol };
    let answer = steps.begun(search, a, b, atA, atB);
    while (answer === steps.WANTED) answer = steps.gone_on(search, of(search.here));
    if (answer !== steps.FOUND) throw new Error("the time of a contact is not found: take a smaller step");
    return search.here;
  }
  const zero = (of, a, b) => root(of, a, b, of(a), of(b), Math.max(1e-14 * (b - a), 1e-300), 1e-15);

  // The first point at which a gap falls to 0, or null; its rate changes sign at most once.
  function firstZero(gap, rate, a, b, atA, atB) {
    const [before, after] = [rate(a), rate(b)];
    if (atA > 0 && atB < 0 && !(before > 0 && after < 0)) return zero(gap, a, b);
    const turns = before * after < 0;
    const middle = turns ? zero(rate, a, b) : b;
    if (before < 0) {
      if (atA <= 0) return a;
      return turns && gap(middle) < 0 ? zero(gap, a, middle) : null;
    }
    if (atB >= 0 || !turns) return before === 0 && atB < atA && atA <= 0 ? a : null;
    return gap(middle) > 0 ? zero(gap, middle, b) : middle;
  }

  // A law of contacts.
  //   names, sizes   of each contact; active(k): whether its effect is on
  //   gaps, rates    (t, y) -> array, relative to sizes; impact (t, y, k, bounce) -> state
  //   held           (t, y, forces) -> derivative of the state, then the accelerations of the gaps
  //   restSpeed, span, ny
  function make(law) {
    const { names, sizes, ny } = law;
    const count = names.length;
    const all = [...names.keys()];
    const accelerations = (t, y) => part(law.held(t, y, new Array(count).fill(0)));
    const part = (found) => Array.from(found.subarray(ny, ny + count), (x, k) => x / sizes[k]);
    const now = { held: [], slack: new Array(count).fill(0), fastest: 0, alpha: 0, begun: null };

    function begin(t, y) {
      now.held = [];
      now.slack.fill(0);
      now.fastest = largest(law.rates(t, y));
      now.alpha = ALPHA * Math.max(Math.sqrt(largest(accelerations(t, y))), now.fastest, 1 / law.span);
      const gaps = law.gaps(t, y);
      const deep = all.find((k) => law.active(k) && gaps[k] < -TOLERANCE);
      if (deep !== undefined) throw new Error(`contact ${names[deep]} starts ${shown(-gaps[deep] * sizes[deep])} deep`);
      return all.filter((k) => law.active(k) && gaps[k] <= TOLERANCE);
    }
    const shown = (x) => Number(x.toPrecision(3));

    // The forces of held contacts: 0 <= f, 0 <= a, f a = 0 with a = gap'' + 2 alpha gap' + alpha² gap.
    function holding(held, t0, y0) {
      const own = { held, units: null, top: 0 };
      const motion = (now.alpha / ALPHA) ** 2;
      const system = (t, y, units) => {
        const columns = [null, ...held].map((k, i) => {
          const forces = new Array(count).fill(0);
          if (k !== null) forces[k] = units[i - 1];
          return Float64Array.from(law.held(t, y, forces));
        });
        const [gaps, rates] = [Array.from(law.gaps(t, y)), Array.from(law.rates(t, y))];
        const free = columns.map(part);
        const matrix = held.map((k) => held.map((_, j) => free[j + 1][k] - free[0][k]));
        const offset = held.map((k) => free[0][k] + 2 * now.alpha * rates[k] + now.alpha ** 2 * gaps[k]);
        return { matrix, offset, columns, free };
      };
      own.solve = (t, y) => {
        if (!own.units) {
          const { matrix } = system(t0, y0, held.map(() => STRONG));
          own.top = Math.max(largest(accelerations(t0, y0)), motion);
          own.units = matrix.map((row, i) => own.top / (Math.abs(row[i]) / STRONG || own.top));
        }
        const { matrix, offset, columns, free } = system(t, y, own.units);
        const forces = complementary(matrix, offset);
        if (!forces) throw new Error(`no contact forces keep ${held.map((k) => names[k]).join(", ")} from closing`);
        const result = columns[0].slice();
        for (let i = 0; i < result.length; i += 1) {
          let total = 0;
          for (let j = 0; j < held.length; j += 1) total += (columns[j + 1][i] - columns[0][i]) * forces[j];
          result[i] += total;
        }
        const scale = Math.max(largest(free[0]), motion);
        const left = offset.map((x, i) => dot(matrix[i], forces) + x);
        return {
          result,
          forces: forces.map((f, i) => f * own.units[i]),
          pushes: forces.map((f, i) => f * matrix[i][i]),
          parts: left.map((x) => (Math.abs(x) <= PARTING * scale ? 0 : x)),
        };
      };
      return own;
    }

    // The strikes at a time: the state after them, and events; it decides which contacts are held.
    function strike(t, y, closed) {
      const near = Array.from(law.gaps(t, y), (gap) => gap <= TOLERANCE);
      const touching = all.filter((k) => law.active(k) && (near[k] || closed.includes(k) || now.held.includes(k)));
      const free = accelerations(t, y);
      const top = largest(free);
      now.fastest = Math.max(now.fastest, largest(law.rates(t, y)));
      const nothing = STILL * Math.max(now.fastest, Math.sqrt(top));
      const least = free.map((a, k) => {
        if (a > AWAY * top) return 0;
        return law.restSpeed ? law.restSpeed / sizes[k] : Math.sqrt(2 * RISE * top);
      });
      const speeds = new Map();
      for (let n = 0; touching.length; n += 1) {
        if (n === STRIKES * touching.length) throw new Error(`the impacts at t = ${shown(t)} do not end: take less restitution`);
        const rates = law.rates(t, y);
        const contact = touching.reduce((a, b) => (rates[b] < rates[a] ? b : a));
        const speed = -rates[contact];
        if (!(speed > nothing)) break;
        const bounces = speed >= least[contact] && n < BOUNCES * touching.length;
        y = Float64Array.from(law.impact(t, y, contact, bounces ? 1 : 0));
        speeds.set(contact, Math.max(speeds.get(contact) ?? 0, speed));
      }
      const before = now.held;
      now.held = still(t, y, touching, nothing);
      const rates = Array.from(law.rates(t, y));
      for (const k of touching) {
        now.slack[k] = rates[k] <= nothing && !now.held.includes(k) ? slackOf(t, y, k) : 0;
      }
      const event = (k, kind) => ({ t, contact: names[k], kind, speed: (speeds.get(k) ?? 0) * sizes[k] });
      const events = [
        ...[...speeds.keys()].sort((a, b) => a - b).filter((k) => speeds.get(k) >= least[k]).map((k) => event(k, "impact")),
        ...now.held.filter((k) => !before.includes(k)).map((k) => event(k, "rest")),
        ...before.filter((k) => !now.held.includes(k)).map((k) => event(k, "lift")),
      ];
      return { y, events };
    }

    function still(t, y, touching, nothing) {
      const rates = law.rates(t, y);
      const slow = touching.filter((k) => rates[k] <= nothing);
      if (!slow.length) return [];
      const { pushes, parts } = holding(slow, t, y).solve(t, y);
      return slow.filter((_, i) => pushes[i] > 0 || parts[i] <= 0);
    }

    const slackOf = (t, y, k) => Math.max(TOLERANCE, 0.01 * TOLERANCE - law.gaps(t, y)[k]);

    // The time at which contacts first close in a step, and which; state(s) is that after s seconds.
    function closing(t, length, state) {
      const apart = all.filter((k) => law.active(k) && !now.held.includes(k));
      if (!apart.length) return null;
      const of = (values) => (k, s) => values(t + s, state(s))[k];
      const [gapOf, rate] = [of(law.gaps), of(law.rates)];
      const gap = (k, s) => gapOf(k, s) + now.slack[k];
      const at = (values, s) => Array.from(values(t + s, state(s)));
      const [gapsA, ratesA, gapsB, ratesB] = [at(law.gaps, 0), at(law.rates, 0), at(law.gaps, length), at(law.rates, length)];
      const found = [];
      for (const k of apart) {
        const [atA, atB] = [gapsA[k] + now.slack[k], gapsB[k] + now.slack[k]];
        if (!(atB < 0 || (ratesA[k] < 0 && ratesB[k] > 0))) continue;
        const s = firstZero((x) => gap(k, x), (x) => rate(k, x), 0, length, atA, atB);
        if (s !== null) found.push([s, k]);
      }
      return first(found, 1e-12 * length);
    }

    // The time at which held contacts first open in a step, and which.
    function opening(held, t, length, state) {
      const { pushes, parts } = held.solve(t + length, state(length));
      const found = [];
      held.held.forEach((k, i) => {
        if (!(pushes[i] === 0 && parts[i] > 0)) return;
        const pressed = (s) => {
          const there = held.solve(t + s, state(s));
          return there.pushes[i] - there.parts[i];
        };
        found.push([pressed(0) > 0 ? zero(pressed, 0, length) : 0, k]);
      });
      return first(found, TOGETHER * length);
    }

    function first(found, together) {
      if (!found.length) return null;
      const s = Math.min(...found.map(([x]) => x));
      return { s, which: found.filter(([x]) => x <= s + together).map(([, k]) => k) };
    }

    function release(t, y, opened) {
      now.held = now.held.filter((k) => !opened.includes(k));
      for (const k of opened) now.slack[k] = slackOf(t, y, k);
      return opened.map((k) => ({ t, contact: names[k], kind: "lift", speed: 0 }));
    }

    function settle(t, y) {
      const gaps = law.gaps(t, y);
      for (const k of all) if (now.slack[k] && gaps[k] > TOLERANCE) now.slack[k] = 0;
    }

    return { now, active: law.active, begin, holding, strike, closing, opening, release, settle };
  }

  return { make, complementary, root };
})();

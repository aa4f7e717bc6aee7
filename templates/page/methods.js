// `methods`: those with equal steps, which are those of the engine.
//
//   make(free)   for the problem of the page without held contacts: change(problem, t, y, h), which returns
//                y(t + h) - y(t); the next call may reuse the array
//   suits(free)  whether it can make steps of the mechanism, if not every method can
//
// problem: {ny, positions, others, steps, held, f(t, y), sample(k), implicitStep(t, y, h) or null}; f returns an array that its next call may
// reuse; `steps` are the functions of the engine, `held` the constraints of loops, or null; see `loops`.

const methods = (() => {
  // After more iterations than SLOW the next step takes other factors; after more than MOST their end says
  // too little of the error, and Newton's method itself is taken.
  const [SLOW, MOST] = [12, 15];
  const [STATES, VELOCITIES] = [3, 3]; // at which it is looked whether leapfrog suits

  // What the engine is given, for a problem `of`. For small arrays a loop is faster than `set`.
  const systemOf = (free) => {
    const { ny, steps } = free;
    const sizes = new Float64Array(ny).fill(1);
    const system = {
      of: free,
      derivative(t, y, rates) {
        const slope = system.of.f(t, y);
        for (let k = 0; k < ny; k += 1) rates[k] = slope[k];
      },
      implicit_step(t, y, h, change) {
        const made = free.implicitStep(t, y, h);
        for (let k = 0; k < ny; k += 1) change[k] = made[k];
      },
      jacobian: (t, y, out) => steps.differences(system, sizes, t, y, out),
    };
    return system;
  };
  const checked = (count) => {
    if (!(count > 0)) throw new Error("there is no step here that solves its equations: take a smaller step");
  };

  // `of(system, free, y)` gives a function that makes a step.
  const explicit = (of) => (free) => {
    const [step, system] = [free.steps.records.Step({}), systemOf(free)];
    let make = null;
    return (problem, t, y, h) => {
      system.of = problem;
      make ??= of(system, free, y);
      checked(make(t, y, h, step) ?? 1);
      return step.change;
    };
  };
  const rungeKutta = (name) => explicit((system, { steps }) => (...given) => steps[`runge_kutta_${name}`](system, ...given));
  const semiImplicit = explicit((system, { steps, positions }) => (...given) => steps.semi_implicit_euler(system, positions, ...given));
  const resisted = explicit((system, { steps }) => (...given) => steps.linearly_implicit(system, ...given));
  const splitOf = (system, { steps, positions, others }, y) => {
    const split = steps.records.Split({ positions, others });
    steps.constant_rates(system, positions, others, y, split.rates);
    return split;
  };
  // With loops the steps are those of RATTLE.
  const leapfrogs = (system, free, y) => {
    const { steps, held } = free;
    if (!held) {
      const split = splitOf(system, free, y);
      return { changed: (t, z, h, step) => (steps.leapfrog(system, split, t, z, h, step), 1) };
    }
    const { nv, rows } = held;
    const room = steps.records.Linked({ n: nv, rows });
    return { changed: (t, z, h, step) => steps.rattle(held, t, z, h, room, step) };
  };
  const leapfrog = explicit((...given) => leapfrogs(...given).changed);
  const composed = (name) => explicit((system, free, y) => {
    const parts = leapfrogs(system, free, y);
    return (...given) => free.steps[`composed_${name}`](parts, ...given);
  });
  const suits = (free) => {
    const { steps, positions, others, held } = free;
    const [system, states] = [systemOf(free), [...Array(STATES).keys()].map(free.sample)];
    if (free.touches || !positions.length) return false;
    if (!held) {
      const split = splitOf(system, free, states[0]);
      const splits = (y, t) =>
        [others, positions].every((group) => steps.coupled(system, group.length, group, t, y) < 0) && steps.varying(system, split, t, y) < 0;
      return states.every(splits);
    }
    const { nv, rows } = held;
    if (!held.mechanism.kineticSlopes || free.ny !== 2 * nv) return false;
    const [early, late] = [0.1, 1.7].map((t) => Array.from(free.f(t, states[0])));
    if (early.some((x, i) => x !== late[i])) return false;
    const room = steps.records.Linked({ n: nv, rows });
    const moving = (k) => states[0].map((x, i) => (i < nv ? x : Math.cos(i + k)));
    return [...Array(VELOCITIES).keys()].every((k) => steps.moved_force(held, moving(k), room) === -1);
  };

  // Implicit methods: with loops, with symmetric projection. Else the factors of a step are kept while they
  // serve: they affect how fast the iteration converges, not where to.
  const implicit = (name, many) => (free) => {
    const { ny, steps, held, positions } = free;
    const { Stages, Projected } = steps.records;
    const system = systemOf(free);
    const stages = Stages({ many, positions: positions.length });
    if (held) {
      const { n, nv, rows, quaternions } = held;
      const room = Projected({ n, nv, rows, many: quaternions.length / 4, stages: many + 1, states: ny, quaternions });
      return (problem, t, y, h) => {
        system.of = problem;
        checked(steps[`projected_change_${name}`](system, held, t, h, y, stages, room));
        return stages.change;
      };
    }
    let [length, count] = [0, 0];
    return (problem, t, y, h) => {
      const make = () => steps[`implicit_change_${name}`](system, t, h, y, stages);
      stages.has_factors = problem === system.of && h === length && 0 < count && count <= SLOW;
      stages.simplified = true;
      [system.of, length] = [problem, h];
      count = make();
      if (count <= 0 || count > MOST) {
        stages.simplified = stages.has_factors = false;
        count = make();
      }
      checked(count);
      return stages.change;
    };
  };

  return [
    { name: "euler", about: "explicit Euler, order 1", make: rungeKutta("euler") },
    { name: "semi_implicit_euler", about: "symplectic Euler, order 1", make: semiImplicit },
    { name: "leapfrog", about: "Störmer-Verlet, order 2", make: leapfrog, suits },
    { name: "leapfrog_4", about: "leapfrog composed to order 4", make: composed("leapfrog_4"), suits },
    { name: "leapfrog_6", about: "leapfrog composed to order 6", make: composed("leapfrog_6"), suits },
    { name: "rk4", about: "classical Runge-Kutta method, order 4", make: rungeKutta("rk4") },
    { name: "linearly_implicit", about: "symplectic Euler, linearly implicit in stiff forces, order 1", make: resisted, suits: (free) => Boolean(free.implicitStep) && !free.touches },
    { name: "implicit_midpoint", about: "implicit midpoint rule, order 2", make: implicit("implicit_midpoint", 1) },
    { name: "gauss_4", about: "Gauss collocation, order 4", make: implicit("gauss_4", 2) },
    { name: "gauss_6", about: "Gauss collocation, order 6", make: implicit("gauss_6", 3) },
  ];
})();

// `methods`: those with equal steps: the arithmetic of `eomgen.run.integrators`, sums in the same order.
// `change(problem, t, y, h)` returns y(t + h) - y(t); the next call may reuse the array.
//
// problem: {ny, positions, others, steps, f(t, y)}; f returns an array that its next call may reuse, and
// `steps` are the functions of the engine.

const methods = (() => {
  // After more iterations than SLOW the next step takes other factors; after more than MOST their end says
  // too little of the error, and Newton's method itself is taken.
  const [SLOW, MOST] = [9, 15];

  // What the engine is given, for a problem `of`. For small arrays a loop is faster than `set`.
  const systemOf = (ny) => {
    const system = {
      of: null,
      derivative(t, y, rates) {
        const slope = system.of.f(t, y);
        for (let k = 0; k < ny; k += 1) rates[k] = slope[k];
      },
      // By differences.
      jacobian(t, y, out) {
        const [state, slope] = [y.slice(), system.of.f(t, y).slice()];
        for (let k = 0; k < ny; k += 1) {
          state[k] += 2e-8 * Math.max(1, Math.abs(y[k]));
          const [ahead, length] = [system.of.f(t, state), state[k] - y[k]];
          for (let i = 0; i < ny; i += 1) out[i * ny + k] = (ahead[i] - slope[i]) / length;
          state[k] = y[k];
        }
      },
    };
    return system;
  };

  // Explicit methods are the engine's own: `of(steps, system, problem, y)` gives one that makes a step.
  const explicit = (of) => (ny) => {
    const step = { change: new Float64Array(ny), place: new Float64Array(ny), slope: new Float64Array(ny) };
    const system = systemOf(ny);
    let make = null;
    return (problem, t, y, h) => {
      system.of = problem;
      make ??= of(problem.steps, system, problem, y);
      make(t, y, h, step);
      return step.change;
    };
  };
  const leapfrogs = (steps, system, { positions, others }, y) => {
    const rates = new Float64Array(positions.length * others.length);
    steps.constant_rates(system, positions, others, y, rates);
    const split = { positions, others, rates };
    return { changed: (t, z, h, step) => (steps.leapfrog(system, split, t, z, h, step), 1) };
  };

  const euler = explicit((steps, system) => (...given) => steps.runge_kutta_euler(system, ...given));
  const rungeKutta = explicit((steps, system) => (...given) => steps.runge_kutta_rk4(system, ...given));
  const semiImplicitEuler = explicit((steps, system, { positions }) => (...given) =>
    steps.semi_implicit_euler(system, positions, ...given));
  const leapfrog = explicit((...given) => leapfrogs(...given).changed);
  const composed = (name) => explicit((steps, ...given) => {
    const parts = leapfrogs(steps, ...given);
    return (...more) => steps[`composed_${name}`](parts, ...more);
  });

  // Implicit methods are the engine's, too. The factors of a step are kept while they serve: they affect
  // how fast the iteration converges, not where to.
  const implicit = (name, many) => (ny) => {
    const n = many * ny;
    const numbers = (rows, columns = 1) => new Float64Array(rows * columns);
    const stages = { many, positions: 0, simplified: true, has_factors: false };
    Object.assign(stages, { changes: numbers(n), update: numbers(n), couplings: numbers(many, many) });
    Object.assign(stages, { jacobians: numbers(n, ny), matrix: numbers(n, n) });
    const factors = { n, first: 0, diagonal: 0, right: numbers(n, n), columns: numbers(n, n) };
    for (const [part, size] of [["entries", n * n], ["ends", n], ["order", n]]) factors[part] = new Int32Array(size);
    const [system, change] = [systemOf(ny), numbers(ny)];
    let [length, count] = [0, 0];
    return (problem, t, y, h) => {
      const make = problem.steps[name];
      stages.has_factors = problem === system.of && h === length && 0 < count && count <= SLOW;
      stages.simplified = true;
      stages.positions = problem.positions.length;
      [system.of, length] = [problem, h];
      count = make(system, t, h, y, stages, factors, change);
      if (count <= 0 || count > MOST) {
        stages.simplified = stages.has_factors = false;
        count = make(system, t, h, y, stages, factors, change);
      }
      if (count <= 0) throw new Error("Newton's iteration does not converge: take a smaller step");
      return change;
    };
  };

  return [
    { name: "euler", about: "explicit Euler, order 1", make: euler },
    { name: "semi_implicit_euler", about: "symplectic Euler, order 1", make: semiImplicitEuler },
    { name: "leapfrog", about: "Störmer-Verlet, order 2", make: leapfrog, separable: true },
    { name: "leapfrog_4", about: "leapfrog composed to order 4", make: composed("leapfrog_4"), separable: true },
    { name: "leapfrog_6", about: "leapfrog composed to order 6", make: composed("leapfrog_6"), separable: true },
    { name: "rk4", about: "classical Runge-Kutta method, order 4", make: rungeKutta },
    { name: "implicit_midpoint", about: "implicit midpoint rule, order 2", make: implicit("implicit_change_implicit_midpoint", 1) },
    { name: "gauss_4", about: "Gauss collocation, order 4", make: implicit("implicit_change_gauss_4", 2) },
    { name: "gauss_6", about: "Gauss collocation, order 6", make: implicit("implicit_change_gauss_6", 3) },
  ];
})();

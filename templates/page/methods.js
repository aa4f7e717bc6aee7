// `methods`: those with equal steps: the arithmetic of `eomgen.run.integrators`, sums in the same order.
// `change(problem, t, y, h)` returns y(t + h) - y(t); the next call may reuse the array.
//
// problem: {ny, positions, others, steps, f(t, y)}; f returns an array that its next call may reuse, and
// `steps` are the functions of the engine.

const methods = (() => {
  const EPS = 2 ** -52;
  const NEWTON = { most: 30, roundoff: 4 * EPS, noise: 1e-10, nothing: 1e-13, small: 1e-9 };
  const SLOW = 10; // with more iterations than these, the next step takes another Jacobian

  // Explicit methods are the engine's own: `of(steps, system, problem, y)` gives one that makes a step.
  const explicit = (of) => (ny) => {
    const step = { change: new Float64Array(ny), place: new Float64Array(ny), slope: new Float64Array(ny) };
    const system = { f: null, derivative: (t, y, rates) => rates.set(system.f(t, y)) };
    let make = null;
    return (problem, t, y, h) => {
      system.f = problem.f;
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

  // Implicit methods of s stages, solved by Newton's method to roundoff. Their equations are those of
  // `run.integrators.implicit_stages`. The Jacobian is by differences and is kept while it serves:
  // it affects how fast the iteration converges, not where to.
  const implicit = (shares, b, c) => (ny) => {
    const s = b.length;
    const n = s * ny;
    const changes = new Float64Array(n);
    const update = new Float64Array(n);
    const state = new Float64Array(ny);
    const change = new Float64Array(ny);
    const newton = makeNewton(n);
    let age = Infinity;
    let length = 0;
    const solved = (y, size, previous) => {
      let largest = 0;
      const scale = change; // reused: it is computed at the end only
      for (let k = 0; k < ny; k += 1) {
        let total = Math.abs(changes[k]);
        for (let i = 1; i < s; i += 1) total += Math.abs(changes[i * ny + k]);
        scale[k] = Math.abs(y[k]) + total;
        largest = Math.max(largest, scale[k]);
      }
      let all = true;
      for (let k = 0; k < n && all; k += 1) {
        const allowed = NEWTON.roundoff * Math.max(scale[k % ny], NEWTON.small * largest);
        all = Math.abs(update[k]) * (size / previous) <= allowed;
      }
      if (all) return true;
      return previous <= 2 * size && size <= Math.max(NEWTON.noise * largest, NEWTON.nothing);
    };
    // One attempt with the factors there are; the number of iterations, or 0 if it failed.
    const iterate = (problem, t, y, h) => {
      changes.fill(0);
      let previous = 0;
      let done = false;
      for (let count = 1; count <= NEWTON.most; count += 1) {
        for (let i = 0; i < s; i += 1) {
          for (let k = 0; k < ny; k += 1) {
            let total = shares[i][0] * changes[k];
            for (let j = 1; j < s; j += 1) total += shares[i][j] * changes[j * ny + k];
            state[k] = y[k] + total;
          }
          const slope = problem.f(t + c[i] * h, state);
          for (let k = 0; k < ny; k += 1) update[i * ny + k] = h * b[i] * slope[k] - changes[i * ny + k];
        }
        newton.solve(update);
        let size = 0;
        for (let k = 0; k < n; k += 1) {
          changes[k] += update[k];
          const part = Math.abs(update[k]);
          if (!(part <= size)) size = part; // nan too
        }
        if (!Number.isFinite(size)) return 0;
        // Once more after it has converged: a Jacobian that is not exact leaves an error of the last digit.
        if (size === 0 || done) return count;
        done = previous > 0 && solved(y, size, previous);
        if (!done && count > 5 && size > 0.9 * previous && size > 1e-6) return 0; // it does not converge
        previous = size;
      }
      return 0;
    };
    return (problem, t, y, h) => {
      let count = 0;
      if (age < Infinity && h === length && problem === newton.of) count = iterate(problem, t, y, h);
      for (let attempt = 0; !count && attempt < 3; attempt += 1) {
        // First at the middle of the step as it starts, then at the stages reached.
        if (attempt === 0) state.set(y);
        else for (let k = 0; k < ny; k += 1) {
          let total = 0;
          for (let i = 0; i < s; i += 1) total += changes[i * ny + k];
          state[k] = Number.isFinite(total) ? y[k] + total / 2 : y[k];
        }
        if (!newton.factor(problem, t + h / 2, state, h, shares, b)) continue;
        count = iterate(problem, t, y, h);
        length = h;
      }
      age = count && count <= SLOW ? 0 : Infinity;
      if (!count) throw new Error("Newton's iteration does not converge: take a smaller step");
      for (let k = 0; k < ny; k += 1) {
        let total = changes[k];
        for (let i = 1; i < s; i += 1) total += changes[i * ny + k];
        change[k] = total;
      }
      return change;
    };
  };

  // The matrix 1 - h b_i share_ij J of the stages, with J by differences, as factors L and U.
  function makeNewton(n) {
    const matrix = new Float64Array(n * n);
    const order = new Int32Array(n);
    const right = new Float64Array(n);
    const newton = { of: null };
    newton.factor = (problem, t, y, h, shares, b) => {
      const { ny, f } = problem;
      const state = Float64Array.from(y);
      const slope = Float64Array.from(f(t, y));
      newton.of = problem;
      for (let k = 0; k < ny; k += 1) {
        const ahead = y[k] + 2e-8 * Math.max(1, Math.abs(y[k]));
        state[k] = ahead;
        const other = f(t, state);
        state[k] = y[k];
        for (let r = 0; r < ny; r += 1) {
          const entry = (other[r] - slope[r]) / (ahead - y[k]);
          for (let i = 0; i < b.length; i += 1) {
            for (let j = 0; j < b.length; j += 1) {
              const one = i === j && r === k ? 1 : 0;
              matrix[(i * ny + r) * n + j * ny + k] = one - h * b[i] * shares[i][j] * entry;
            }
          }
        }
      }
      return factor();
    };
    function factor() {
      for (let i = 0; i < n; i += 1) order[i] = i;
      for (let k = 0; k < n; k += 1) {
        let pivot = k;
        for (let i = k + 1; i < n; i += 1) {
          if (Math.abs(matrix[i * n + k]) > Math.abs(matrix[pivot * n + k])) pivot = i;
        }
        const largest = matrix[pivot * n + k];
        if (!(Math.abs(largest) > 0) || !Number.isFinite(largest)) return false;
        if (pivot !== k) {
          for (let j = 0; j < n; j += 1) {
            const kept = matrix[k * n + j];
            matrix[k * n + j] = matrix[pivot * n + j];
            matrix[pivot * n + j] = kept;
          }
          const kept = order[k];
          order[k] = order[pivot];
          order[pivot] = kept;
        }
        for (let i = k + 1; i < n; i += 1) {
          const factor = matrix[i * n + k] / largest;
          if (factor === 0) continue;
          matrix[i * n + k] = factor;
          for (let j = k + 1; j < n; j += 1) matrix[i * n + j] -= factor * matrix[k * n + j];
        }
      }
      return true;
    }
    newton.solve = (values) => {
      for (let i = 0; i < n; i += 1) {
        let total = values[order[i]];
        for (let j = 0; j < i; j += 1) total -= matrix[i * n + j] * right[j];
        right[i] = total;
      }
      for (let i = n - 1; i >= 0; i -= 1) {
        let total = right[i];
        for (let j = i + 1; j < n; j += 1) total -= matrix[i * n + j] * right[j];
        right[i] = total / matrix[i * n + i];
      }
      values.set(right);
    };
    return newton;
  }

  // Gauss collocation: Hairer, Norsett, Wanner, Solving ODEs I, tables II.7.3 and II.7.4.
  const late = 1 / 2 + Math.sqrt(3) / 3;
  const next = 1 / 2 + 3 * Math.sqrt(15) / 20;
  const last = 1 / 2 + 3 * Math.sqrt(15) / 25;
  const midpoint = implicit([[1 / 2]], [1], [1 / 2]);
  const gauss4 = implicit(
    [[1 / 2, 1 - late], [late, 1 / 2]],
    [1 / 2, 1 / 2], [1 / 2 - Math.sqrt(3) / 6, 1 / 2 + Math.sqrt(3) / 6]);
  const gauss6 = implicit(
    [[1 / 2, 1 - next, 1 - last], [next, 1 / 2, 1 - next], [last, next, 1 / 2]],
    [5 / 18, 4 / 9, 5 / 18], [1 / 2 - Math.sqrt(15) / 10, 1 / 2, 1 / 2 + Math.sqrt(15) / 10]);

  return [
    { name: "euler", about: "explicit Euler, order 1", make: euler },
    { name: "semi_implicit_euler", about: "symplectic Euler, order 1", make: semiImplicitEuler },
    { name: "leapfrog", about: "Störmer-Verlet, order 2", make: leapfrog, separable: true },
    { name: "leapfrog_4", about: "leapfrog composed to order 4", make: composed("leapfrog_4"), separable: true },
    { name: "leapfrog_6", about: "leapfrog composed to order 6", make: composed("leapfrog_6"), separable: true },
    { name: "rk4", about: "classical Runge-Kutta method, order 4", make: rungeKutta },
    { name: "implicit_midpoint", about: "implicit midpoint rule, order 2", make: midpoint },
    { name: "gauss_4", about: "Gauss collocation, order 4", make: gauss4 },
    { name: "gauss_6", about: "Gauss collocation, order 6", make: gauss6 },
  ];
})();

// The constraints of loops, and quaternions of length 1: what the engine is given of them.

// `of` has functions (t, y) by the names of a module's outputs: those with which states are put onto the constraints and, for
// methods that solve for these, others, of which a large mechanism has no `constraint_jacobian`. The constraints are in `sizes`.
// `positions` and `velocities` are the places of these among the states; unit(y) gives quaternions the length 1, and says whether
// that is possible. `placed(t, y)` changes a state in place, and says whether it is on the constraints.
const loopLaw = (of, { states, sizes, positions, velocities, unit }, { moved_onto, PROJECTED }) => {
  const [rows, nv] = [sizes.length, velocities.length];
  const [first, left, after, there] = [rows, rows, rows, states].map((n) => new Float64Array(n));
  const off = { rows, sizes, first, left, after, there };
  const written = (values, out, each = 0) => {
    for (let i = 0; i < values.length; i += 1) out[i] = each ? values[i] / sizes[Math.floor(i / each)] : values[i];
    return true;
  };
  const law = {
    residuals_at: (t, y, out) => written(of.constraint_residuals(t, y), out),
    move_closer(t, y, near) {
      of.project_position(t, y).forEach((x, i) => (near[positions[i]] = x));
      return unit(near);
    },
    hold_velocities(t, y) {
      of.project_velocity(t, y).forEach((x, i) => (y[velocities[i]] = x));
      return true;
    },
    off_by: (t, y, out) => written(of.constraint_residuals(t, y), out, 1),
    drift_at: (t, y, out) => written(of.constraint_rates(t, y), out, 1),
    rows_at(t, y, out) {
      if (of.constraint_jacobian) return written(of.constraint_jacobian(t, y), out, nv);
      const at = (k) => {
        const moved = y.slice();
        velocities.forEach((place, i) => (moved[place] = Number(i === k)));
        return of.constraint_rates(t, moved).slice();
      };
      const rest = at(-1);
      for (let k = 0; k < nv; k += 1) at(k).forEach((x, i) => (out[i * nv + k] = (x - rest[i]) / sizes[i]));
      return true;
    },
    rates_at: (t, y, out) => written(of.derivative(t, y), out),
    inertia_at: (t, y, out) => written(of.mass_matrix(t, y), out),
    slopes_at: (t, y, out) => written(of.kinetic_slopes(t, y), out),
    placed: (t, y) => unit(y) && moved_onto(law, t, y, off) === PROJECTED,
  };
  return law;
};

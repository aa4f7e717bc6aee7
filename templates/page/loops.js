// `makeLoops`: the constraints of a mechanism's loops, as the engine is given them. It needs no document.
//
// unit(y) gives quaternions the length 1; given() returns [p, u]; derivative(t, y). What is returned has
// `placed(t, y)`, which returns the state, changed in place, on the constraints; it throws a sentence where the
// loops cannot be closed, and where the mechanism is singular.

const makeLoops = (mechanism, steps, size, { positions, others, kinds, quaternions, unit, given, derivative }) => {
  const sizes = Float64Array.from(mechanism.constraints, (force) => (force === "N" ? size : 1));
  const [n, nv, rows, ny] = [positions.length, kinds.filter((kind) => kind === "velocity").length, sizes.length, kinds.length];
  const off = steps.records.Residuals({ rows, sizes });
  const written = (values, out, each = 0) => {
    values.forEach((x, i) => (out[i] = each ? x / sizes[Math.floor(i / each)] : x));
    return true;
  };
  const held = {
    mechanism, n, nv, rows, quaternions,
    margin: 0, // how far the last state that was placed is from singular positions, at most 1
    residuals_at: (t, y, out) => written(mechanism.constraintResiduals(t, y, ...given()), out),
    move_closer(t, y, near) {
      mechanism.projectPosition(t, y, ...given()).forEach((x, i) => (near[positions[i]] = x));
      unit(near);
      return true;
    },
    hold_velocities(t, y) {
      held.margin = Math.min(...mechanism.constraintMargins(t, y, ...given()));
      if (held.margin < 1e-9) {
        throw new Error("the mechanism is singular here, as at a dead point: take another start");
      }
      mechanism.projectVelocity(t, y, ...given()).forEach((x, i) => (y[others[i]] = x));
      return true;
    },
    off_by: (t, y, out) => written(mechanism.constraintResiduals(t, y, ...given()), out, 1),
    drift_at: (t, y, out) => written(mechanism.constraintRates(t, y, ...given()), out, 1),
    rows_at(t, y, out) {
      if (mechanism.constraintJacobian) return written(mechanism.constraintJacobian(t, y, ...given()), out, nv);
      const at = (k) => {
        const moved = y.map((x, i) => (kinds[i] === "velocity" ? Number(i === k) : x));
        return mechanism.constraintRates(t, moved, ...given()).slice();
      };
      const rest = at(-1);
      for (let k = 0; k < nv; k += 1) at(n + k).forEach((x, i) => (out[i * nv + k] = (x - rest[i]) / sizes[i]));
      return true;
    },
    rates_at: (t, y, out) => written(derivative(t, y), out),
    inertia_at: (t, y, out) => written(mechanism.massMatrix(t, y, ...given()), out),
    slopes_at: (t, y, out) => written(mechanism.kineticSlopes(t, y, ...given()), out),
    placed(t, y) {
      const why = steps.moved_onto(held, t, unit(y), off);
      if (why === steps.PROJECTED) return y;
      throw new Error("the loops do not close here: take a smaller step or other lengths");
    },
  };
  return held;
};

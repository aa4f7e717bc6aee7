// `makeClosure` returns a state to the constraints of a mechanism's loops, as `eomgen simulate` does
// after each step. It needs no document.
//
// steps: those of `makeSteps`; unit(y) gives quaternions the length 1; given() returns [p, u].

const makeClosure = (mechanism, steps, size, { ny, positions, others, unit, given }) => {
  const sizes = Float64Array.from(mechanism.constraints ?? [], (force) => (force === "N" ? size : 1));
  const rows = sizes.length;
  const [first, left, after] = [0, 0, 0].map(() => new Float64Array(rows));
  const there = new Float64Array(ny);
  const constraints = {
    residuals_at(t, y, out) {
      out.set(mechanism.constraintResiduals(t, y, ...given()));
      return true;
    },
    move_closer(t, y, near) {
      mechanism.projectPosition(t, y, ...given()).forEach((x, i) => (near[positions[i]] = x));
      unit(near);
      return true;
    },
    hold_velocities(t, y) {
      if (Math.min(...mechanism.constraintMargins(t, y, ...given())) < 1e-9) {
        throw new Error("the mechanism is singular here, as at a dead point: take another start");
      }
      mechanism.projectVelocity(t, y, ...given()).forEach((x, i) => (y[others[i]] = x));
      return true;
    },
  };
  // The state y, changed in place. Throws a sentence where the loops cannot be closed, and where the
  // mechanism is singular.
  return (t, y) => {
    unit(y);
    if (!mechanism.projectPosition) return y;
    const why = steps.moved_onto(constraints, ny, rows, t, y, sizes, first, left, after, there);
    if (why === steps.PROJECTED) return y;
    throw new Error("the loops do not close here: take a smaller step or other lengths");
  };
};

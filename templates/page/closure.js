// `closure.onto` returns a state to the constraints of a mechanism's loops, as `eomgen simulate` does
// after each step. It needs no document.

const closure = {
  // The state y, changed in place: Newton's method for the coordinates, then the velocities. Throws a
  // sentence where the loops cannot be closed, and where the mechanism is singular.
  onto(mechanism, { positions, others, unit }, t, y, p, u) {
    unit(y);
    if (!mechanism.projectPosition) return y;
    const violation = (z) => Math.max(...mechanism.constraintResiduals(t, z, p, u).map(Math.abs));
    let off = violation(y);
    for (let n = 0; n < 12 && off > 1e-15; n += 1) {
      const there = y.slice();
      mechanism.projectPosition(t, y, p, u).forEach((x, i) => (there[positions[i]] = x));
      const left = violation(unit(there));
      if (!(left < off)) break; // rounding, or no way towards the constraints
      y.set(there);
      off = left;
    }
    if (!(off <= 1e-6)) throw new Error("the loops do not close here: take a smaller step or other lengths");
    if (Math.min(...mechanism.constraintMargins(t, y, p, u)) < 1e-9) {
      throw new Error("the mechanism is singular here, as at a dead point: take another start");
    }
    mechanism.projectVelocity(t, y, p, u).forEach((x, i) => (y[others[i]] = x));
    return y;
  },
};

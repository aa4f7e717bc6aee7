// `makeLoops`: the constraints of a mechanism's loops, as the engine is given them, and numbers of them. It needs no document.
//
// unit(y) gives quaternions the length 1; given() returns [p, u]; derivative(t, y). `placed(t, y)` returns the state, changed in
// place, on the constraints; it throws a sentence where the loops cannot be closed, and where the mechanism is singular.

const makeLoops = (mechanism, steps, size, { positions, others, kinds, quaternions, unit, given, derivative }) => {
  const sizes = Float64Array.from(mechanism.constraints, (force) => (force === "N" ? size : 1));
  const velocities = others.filter((i) => kinds[i] === "velocity");
  const at = (f) => f && ((t, y) => f(t, y, ...given()));
  const of = {
    derivative,
    constraint_residuals: at(mechanism.constraintResiduals),
    constraint_rates: at(mechanism.constraintRates),
    constraint_jacobian: at(mechanism.constraintJacobian),
    mass_matrix: at(mechanism.massMatrix),
    kinetic_slopes: at(mechanism.kineticSlopes),
    project_position: at(mechanism.projectPosition),
    project_velocity(t, y) {
      held.margin = Math.min(...mechanism.constraintMargins(t, y, ...given()));
      if (held.margin >= 1e-9) return mechanism.projectVelocity(t, y, ...given());
      throw new Error("the mechanism is singular here, as at a dead point: take another start");
    },
  };
  const law = loopLaw(of, { states: kinds.length, sizes, positions, velocities, unit }, steps);
  const held = {
    ...law, mechanism, quaternions, n: positions.length, nv: velocities.length, rows: sizes.length,
    margin: 0, // how far the last state that was placed is from singular positions, at most 1
    placed(t, y) {
      if (law.placed(t, y)) return y;
      throw new Error("the loops do not close here: take a smaller step or other lengths");
    },
  };
  return held;
};

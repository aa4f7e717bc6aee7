// `makeTerms`: the terms of the equations of motion M v̇ + V = Σ Q, at a state. It needs no document. Null for a mechanism
// that does not tell the generalised forces Q of its effects.
//   at(i, {t, y, p, u}, rates)   the terms of equation i, each {kind, name, j, value}, of the kinds
//     inertia   M_ij v̇_j on the left; `rates` is the time derivative of the state, null where it is not known
//     velocity  -V;  effect, constraint, pull   by name;  contact   what rates contain beside all these
// The left sides and the sums of all others are equal. Values are in N m or N, as `units` say.

const makeTerms = (mechanism, data) => {
  if (!mechanism.effectForces || !data.rates) return null;
  const velocities = [...data.states.keys()].filter((k) => data.states[k].kind === "velocity");
  const n = velocities.length;
  const named = data.effects.map(({ name, switch: own }, row) => ({ name, row, own })).filter(({ own }) => own !== null);
  const size = data.dimensions === 3 ? 6 : 3;
  const ROUNDING = 1e-12;

  // The state with other velocities: `parts` are pairs of an index and a value.
  function moving({ t, y, p, u }, parts) {
    const other = Float64Array.from(y);
    for (const k of velocities) other[k] = 0;
    for (const [i, value] of parts) other[velocities[i]] += value;
    return [t, other, p, u];
  }

  // Row i of M: second differences of the kinetic energy, which is quadratic in v.
  function massRow(state, i) {
    const energy = (...parts) => mechanism.kineticEnergy(...moving(state, parts));
    const row = Array.from({ length: n }, (_, j) => {
      const alone = energy([j, 1]) - energy([j, -1]);
      return (energy([i, 1], [j, 1]) - energy([i, 1], [j, -1]) - alone) / 2;
    });
    const own = (j) => (energy([j, 1]) + energy([j, -1])) / 2 - energy();
    return row.map((x, j) => (j !== i && x * x <= ROUNDING ** 2 * own(i) * own(j) ? 0 : x));
  }

  // What a function that is linear in v gives for v_i = 1, without what it gives at rest.
  function slope(name, state, i) {
    const rest = Array.from(mechanism[name](...moving(state, [])));
    return Array.from(mechanism[name](...moving(state, [[i, 1]])), (x, k) => x - rest[k]);
  }

  // The generalised force of the wrench that pulls a body.
  function pulled(state, i) {
    const { first, perBody } = data.pointer ?? { first: state.u.length, perBody: size };
    const wrenches = state.u.slice(first, first + perBody * data.bodies.length);
    if (!wrenches.some((x) => x !== 0)) return 0;
    return slope("bodyVelocities", state, i).reduce((sum, x, k) => sum + x * wrenches[k], 0);
  }

  function at(i, state, rates) {
    const given = [state.t, state.y, state.p, state.u];
    const forces = mechanism.effectForces(...given);
    const terms = named.map(({ name, row }) => ({ kind: "effect", name, value: forces[row * n + i] }));
    terms.unshift({ kind: "velocity", name: "velocities", value: -mechanism.velocityForce(...given)[i] });
    if (data.constraints.length) {
      const along = slope("constraintRates", state, i);
      const multipliers = mechanism.constraintForces(...given);
      data.constraints.forEach((name, k) => terms.push({ kind: "constraint", name, value: multipliers[k] * along[k] }));
    }
    terms.push({ kind: "pull", name: "pointer", value: pulled(state, i) });
    const row = massRow(state, i);
    const inertia = row.map((x, j) => ({ kind: "inertia", name: "", j, value: x && x * (rates ? rates[velocities[j]] : NaN) }));
    if (mechanism.contacts?.length && rates) {
      const free = Float64Array.from(mechanism.derivative(...given));
      const value = row.reduce((sum, x, j) => sum + x * (rates[velocities[j]] - free[velocities[j]]), 0);
      terms.push({ kind: "contact", name: "contacts", value });
    }
    return [...inertia, ...terms];
  }

  return { n, units: velocities.map((k) => (data.states[k].unit === "rad/s" ? "N m" : "N")), at };
};

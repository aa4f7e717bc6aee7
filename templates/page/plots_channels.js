// `makeChannels` lists what can be plotted. A channel is
//   key     its name: theta, joint_forces.hinge.fx, as `eomgen plot --of` takes it, or one like these
//   label, group, unit   what the reader sees
//   family  the function of the mechanism whose result it is read from
//   of      (result) -> value
//   kin     indices of the entries of the result of the same kind: their size shows what is rounding
//   change  whether the value at the start of the run is subtracted
//   color   a CSS colour, if it has one of its own
//   beneath  whether its curve is below the others and wider: a total, which a part may equal

const makeChannels = (data, mechanism) => {
  const space = data.dimensions === 3;
  const axes = space ? ["x", "y", "z"] : ["x", "y"];
  const list = [];
  const add = (key, label, group, unit, family, of, kin, more = {}) =>
    list.push({ key, label, group, unit, family, of, kin, change: false, color: null, beneath: false, ...more });
  const has = (name) => typeof mechanism?.[name] === "function";
  const range = (count) => [...Array(count).keys()];
  const entry = (k) => (values) => values[k];
  const length = (ks) => (values) => Math.hypot(...ks.map((k) => values[k]));

  function addStates() {
    data.states.forEach(({ name, unit }, k) => {
      const kin = range(data.states.length).filter((i) => data.states[i].unit === unit);
      add(name, name, "States", unit, "states", entry(k), kin);
    });
  }

  function addEnergies() {
    if (!has("kineticEnergy") || !has("potentialEnergy")) return;
    const total = ([kinetic, potential]) => kinetic + potential;
    const put = (key, label, of, color, more = {}) =>
      add(key, label, "Energy", "J", "energies", of, [0, 1], { color: `var(--${color})`, ...more });
    put("kinetic_energy", "kinetic energy", entry(0), "kinetic");
    put("potential_energy", "potential energy", entry(1), "potential");
    put("energy", "total energy", total, "total", { beneath: true });
    put("energy_change", "change of total energy", total, "accent", { change: true });
  }

  function addBodies() {
    const count = data.bodies.length;
    const size = space ? 6 : 3;
    const [linear, angular] = space ? [[0, 1, 2], [3, 4, 5]] : [[0, 1], [2]];
    const all = (ks, width) => range(count).flatMap((b) => ks.map((k) => width * b + k));
    const width = space ? 12 : 3;
    const centers = space ? [3, 7, 11] : [0, 1];
    data.bodies.forEach((body, b) => {
      const of = (label) => `${body}: ${label}`;
      if (has("bodyPoses")) {
        centers.forEach((k, i) => add(`body_poses.${body}.${axes[i]}`, of(axes[i]),
          "Positions of centres of mass", "m", "poses", entry(width * b + k), all(centers, width)));
        if (!space) {
          add(`body_poses.${body}.angle`, of("angle"), "Angles of bodies", "rad", "poses",
            entry(3 * b + 2), all([2], 3));
        }
      }
      if (!has("bodyVelocities")) return;
      const at = (ks) => ks.map((k) => size * b + k);
      const speeds = all(linear, size);
      const turns = all(angular, size);
      add(`speed.${body}`, of("speed"), "Speeds of bodies", "m/s", "velocities", length(at(linear)), speeds);
      linear.forEach((k, i) => add(`body_velocities.${body}.v${axes[i]}`, of(`v${axes[i]}`),
        "Speeds of bodies", "m/s", "velocities", entry(size * b + k), speeds));
      if (space) {
        add(`angular_speed.${body}`, of("angular speed"), "Angular speeds of bodies", "rad/s", "velocities",
          length(at(angular)), turns);
      }
      angular.forEach((k, i) => {
        const name = space ? `w${axes[i]}` : "wz";
        add(`body_velocities.${body}.${name}`, of(space ? name.replace("w", "ω") : "angular speed"),
          "Angular speeds of bodies", "rad/s", "velocities", entry(size * b + k), turns);
      });
    });
  }

  function addJoints() {
    if (!has("jointForces")) return;
    const size = space ? 6 : 3;
    const [forces, moments] = space ? [[0, 1, 2], [3, 4, 5]] : [[0, 1], [2]];
    const all = (ks) => range(data.joints.length).flatMap((j) => ks.map((k) => size * j + k));
    data.joints.forEach((joint, j) => {
      const put = (name, label, unit, of, ks) => add(`joint_forces.${joint}${name}`, `${joint}: ${label}`,
        "Joint forces", unit, "joints", of, all(ks));
      const at = (ks) => ks.map((k) => size * j + k);
      put("", "force", "N", length(at(forces)), forces);
      forces.forEach((k, i) => put(`.f${axes[i]}`, `force ${axes[i]}`, "N", entry(size * j + k), forces));
      if (space) put(".moment", "moment", "N m", length(at(moments)), moments);
      moments.forEach((k, i) => put(space ? `.m${axes[i]}` : ".mz", space ? `moment ${axes[i]}` : "moment",
        "N m", entry(size * j + k), moments));
    });
  }

  function addLoads() {
    if (!has("loads")) return;
    const loads = data.loads ?? [];
    const size = space ? 9 : 5;
    const [forces, torques] = space ? [[3, 4, 5], [6, 7, 8]] : [[2, 3], [4]];
    const all = (ks) => range(loads.length).flatMap((l) => ks.map((k) => size * l + k));
    const times = new Map();
    loads.forEach(({ effect, body }, l) => {
      // An effect may load a body at several points.
      const name = `${effect}.${body}`;
      times.set(name, (times.get(name) ?? 0) + 1);
      const nth = times.get(name) > 1 ? times.get(name) : "";
      const put = (kind, unit, ks) => add(`loads.${name}${nth && `.${nth}`}.${kind}`,
        `${effect} on ${body}${nth && ` (${nth})`}: ${kind}`, "Forces of effects", unit, "loads",
        length(ks.map((k) => size * l + k)), all(ks));
      put("force", "N", forces);
      put("torque", "N m", torques);
    });
  }

  // Those of effects without a switch are drives, whose forces are found with the motion.
  function addTerms() {
    if (!has("effectForces")) return;
    const velocities = data.states.filter(({ kind }) => kind === "velocity");
    const unitOf = ({ unit }) => (unit === "rad/s" ? "N m" : "N");
    data.effects.forEach((effect, e) => velocities.forEach((velocity, i) => {
      if (effect.switch === null) return;
      const unit = unitOf(velocity);
      const kin = range(data.effects.length * velocities.length).filter((k) => unitOf(velocities[k % velocities.length]) === unit);
      add(`effect_forces.${effect.name}.${velocity.name}`, `${effect.name} in the equation of ${velocity.name.replace(/_dot$/, "")}`,
        "Terms of the equations of motion", unit, "terms", entry(e * velocities.length + i), kin);
    }));
  }

  function addContacts() {
    const contacts = mechanism?.contacts ?? [];
    const kinOf = (unit) => range(contacts.length).filter((i) => contacts[i].unit === unit);
    contacts.forEach(({ name, unit }, k) => {
      if (has("gaps")) add(`gaps.${name}`, `${name}: gap`, "Contacts", unit, "gaps", entry(k), kinOf(unit));
      if (has("gapRates")) {
        add(`gap_rates.${name}`, `${name}: rate of the gap`, "Contacts", `${unit}/s`, "gapRates", entry(k), kinOf(unit));
      }
    });
  }

  function addInputs() {
    const count = data.pointer?.first ?? data.inputs?.length ?? 0;
    (data.inputs ?? []).slice(0, count).forEach(({ name, unit }, k) =>
      add(`inputs.${name}`, name, "Inputs", unit ?? "", "inputs", entry(k), [k]));
  }

  for (const fill of [addStates, addEnergies, addInputs, addBodies, addJoints, addLoads, addTerms, addContacts]) fill();
  const call = (name) => (row) => mechanism[name](row.t, row.y, row.p, row.u);
  const families = {
    states: (row) => row.y,
    inputs: (row) => row.u,
    energies: (row) => [call("kineticEnergy")(row), call("potentialEnergy")(row)],
    poses: call("bodyPoses"),
    velocities: call("bodyVelocities"),
    joints: call("jointForces"),
    loads: call("loads"),
    terms: call("effectForces"),
    gaps: call("gaps"),
    gapRates: call("gapRates"),
  };
  // Joint forces leave out those of held contacts, so that they are not known while one is held.
  const unknownWhileHeld = new Set(["joints"]);
  // Positions with their velocities: in their order, or by name where there are more positions.
  function pairsOf() {
    const of = (kind) => data.states.filter((s) => s.kind === kind).map((s) => s.name);
    const [positions, velocities] = [of("position"), of("velocity")];
    if (positions.length === velocities.length) return positions.map((name, k) => [name, velocities[k]]);
    return positions.filter((name) => velocities.includes(`${name}_dot`)).map((name) => [name, `${name}_dot`]);
  }
  // Whether a contact is held at each time, from the events of contacts {t, contact, kind} of a run.
  function heldAt(times, events) {
    const since = new Map();
    const spans = [];
    for (const { t, contact, kind } of events) {
      if (kind === "rest") since.set(contact, t);
      else if (kind === "lift" && since.has(contact)) {
        spans.push([since.get(contact), t]);
        since.delete(contact);
      }
    }
    for (const t of since.values()) spans.push([t, Infinity]);
    return Array.from(times, (t) => spans.some(([from, to]) => from <= t && t <= to));
  }

  // Whether a contact is held after these events, to which events are only added.
  let seen = { first: null, count: 0, held: new Set() };
  function heldAfter(events) {
    if (seen.first !== events[0] || seen.count > events.length) {
      seen = { first: events[0], count: 0, held: new Set() }; // another run
    }
    for (; seen.count < events.length; seen.count += 1) {
      const { contact, kind } = events[seen.count];
      if (kind === "rest") seen.held.add(contact);
      else if (kind === "lift") seen.held.delete(contact);
    }
    return seen.held.size > 0;
  }

  const byKey = new Map(list.map((channel) => [channel.key, channel]));
  return {
    list,
    pairs: pairsOf(),
    states: data.states.map((s) => s.name),
    get: (key) => byKey.get(key),
    families,
    unknownWhileHeld,
    heldAt,
    heldAfter,
    mayHold: Boolean(mechanism?.contacts?.length), // so that it must be said where no contact is held
  };
};

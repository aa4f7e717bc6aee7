// `contacts`: rigid contacts and stops, by the rules of `eomgen.engine.contacts` and `contact_runs`,
// for steps of equal length. Gaps, their rates and accelerations are relative to `sizes`.

const contacts = (() => {
  const shown = (x) => Number(x.toPrecision(3));

  // A law of contacts.
  //   names, sizes   of each contact; active(k): whether its effect is on
  //   gaps, rates    (t, y) -> array, m or rad; impact (t, y, k, bounce) -> state
  //   held           (t, y, forces) -> derivative of the state, the accelerations of the gaps, powers
  //   restSpeed, span, ny; many: the number of results of `held`
  function make(law) {
    const { names, sizes, ny } = law;
    const count = names.length;
    const all = [...names.keys()];
    const steps = makeSteps({ STATES: ny, CONTACTS: count, PRESSED: law.many });
    const of = {
      gaps: (t, y, out) => law.gaps(t, y).forEach((x, k) => (out[k] = law.active(k) ? x / sizes[k] : Infinity)),
      rates: (t, y, out) => law.rates(t, y).forEach((x, k) => (out[k] = law.active(k) ? x / sizes[k] : 0)),
      impact: (t, y, k, bounce, out) => out.set(law.impact(t, y, k, bounce)),
      held: (t, y, forces, out) => {
        out.set(law.held(t, y, forces));
        for (const k of all) out[ny + k] /= sizes[k];
      },
    };
    const numbers = (n = count) => new Float64Array(n);
    const now = steps.records.Touching({ rest: Float64Array.from(sizes, (size) => (law.restSpeed ? law.restSpeed / size : -1)) });
    const place = steps.records.Place({});
    const flagged = (which) => Int32Array.from(all, (k) => (which.includes(k) ? 1 : 0));
    const listed = (flags) => all.filter((k) => flags[k]);
    const held = () => listed(now.holds);
    const unheld = () => new Error(`no contact forces keep ${held().map((k) => names[k]).join(", ")} from closing`);

    // Begin a run; the contacts that touch.
    function begin(t, y) {
      const gaps = numbers();
      steps.begin(of, now, t, y, law.span);
      const deep = steps.deepest(of, t, y);
      of.gaps(t, y, gaps);
      if (deep >= 0) throw new Error(`contact ${names[deep]} starts ${shown(-gaps[deep] * sizes[deep])} deep`);
      return all.filter((k) => gaps[k] <= steps.TOLERANCE);
    }

    // The derivative of the state under the forces of held contacts; the next call reuses the array.
    function derivative(t, y) {
      if (!steps.press(of, now, t, y)) throw unheld();
      return now.found.subarray(0, ny);
    }

    // The strikes at a time: the state after them, and events; it decides which contacts are held.
    function strike(t, y, closed) {
      const before = held();
      Object.assign(place, { t, y: y.slice(), closed: flagged(closed) });
      const answer = steps.strike(of, now, place);
      const { speeds, least } = now;
      if (answer === steps.ENDLESS) throw new Error(`the impacts at t = ${shown(t)} do not end: take less restitution`);
      if (answer === steps.NO_FORCES) throw unheld();
      const event = (k, kind, speed = speeds[k]) => ({ t, contact: names[k], kind, speed: speed * sizes[k] });
      const events = [
        ...all.filter((k) => speeds[k] > 0 && speeds[k] >= least[k]).map((k) => event(k, "impact")),
        ...held().filter((k) => !before.includes(k)).map((k) => event(k, "rest")),
        ...before.filter((k) => !now.holds[k]).map((k) => event(k, "lift", 0)),
      ];
      return { y: place.y, events };
    }

    // Go to the end of a step from `y` at t, or to the first event in it: where that is, the contacts that close,
    // and events if some open; `whole` if nothing happens.
    function taken(t, y, end, state) {
      const within = { state: (s, out) => out.set(state(s)) };
      Object.assign(place, { t, y: y.slice() });
      const why = steps.taken(of, within, now, {}, place, end, 1);
      if (why === steps.NOT_KEPT) throw unheld();
      if (why === steps.NOT_FOUND) throw new Error("the time of a contact is not found: take a smaller step");
      if (why === steps.ENDLESSLY) throw new Error("contacts strike or open without end: take another step");
      const opened = why === steps.OPENED ? lifted(place.t, listed(place.opened)) : [];
      return { ...place, whole: why === steps.WHOLE, closed: why === steps.CLOSED ? listed(place.closed) : [], opened };
    }

    const lifted = (t, which) => which.map((k) => ({ t, contact: names[k], kind: "lift", speed: 0 }));

    // Let go contacts whose effects are switched off.
    function release(t, y, opened) {
      steps.release(of, now, t, y, flagged(opened));
      return lifted(t, opened);
    }

    return { held, active: law.active, begin, derivative, strike, taken, release };
  }

  return { make };
})();

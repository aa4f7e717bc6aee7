// `contacts`: rigid contacts and stops of a live motion, by the rules of `eomgen.engine.contacts` and `contact_steps`.

const contacts = (() => {
  const shown = (x) => Number(x.toPrecision(3));

  // The contacts of `law`, as `contactLaw` is given it, beside which are their names, restSpeed and span; many: the number of
  // results of `held`. `y` is the state of the motion, which events change.
  function make({ names, restSpeed, span, many, ...given }, y) {
    const { states, sizes, active } = given;
    const all = [...names.keys()];
    const steps = makeSteps({ STATES: states, CONTACTS: names.length, PRESSED: many });
    const law = contactLaw(given);
    const now = steps.records.Touching({ rest: Float64Array.from(sizes, (size) => (restSpeed ? restSpeed / size : -1)) });
    const at = steps.records.Place({ y });
    const listed = (flags) => all.filter((k) => flags[k]);
    const held = () => listed(now.holds);
    const event = (kind) => (k) => ({ t: at.t, contact: names[k], kind, speed: kind === "lift" ? 0 : now.speeds[k] * sizes[k] });
    const unheld = () => new Error(`no contact forces keep ${held().map((k) => names[k]).join(", ")} from closing`);

    function failure(why) {
      if (why === steps.NOT_KEPT) return unheld();
      if (why === steps.NOT_FOUND) return new Error("the time of a contact is not found: take a smaller step");
      if (at.events > steps.MOST_EVENTS) return new Error("contacts strike or open without end: take another step");
      return new Error(`the impacts at t = ${shown(at.t)} do not end: take less restitution`);
    }

    // The events of what the engine does; null if there was none.
    function eventsOf(act) {
      const before = held();
      const why = act();
      if (why > steps.OPENED) throw failure(why);
      if (why === steps.OPENED) return listed(at.opened).map(event("lift"));
      if (!listed(at.closed).length) return null;
      const strikes = all.filter((k) => now.speeds[k] > 0 && now.speeds[k] >= now.least[k]);
      return [
        ...strikes.map(event("impact")),
        ...held().filter((k) => !before.includes(k)).map(event("rest")),
        ...before.filter((k) => !now.holds[k]).map(event("lift")),
      ];
    }

    // Begin a run: contacts that touch strike or are held.
    function begin(t) {
      const gaps = new Float64Array(names.length);
      at.t = t;
      steps.begin(law, now, t, y, span);
      const deep = steps.deepest(law, t, y);
      law.gaps(t, y, gaps);
      if (deep >= 0) throw new Error(`contact ${names[deep]} starts ${shown(-gaps[deep] * sizes[deep])} deep`);
      return eventsOf(() => steps.met(law, now, at)) ?? [];
    }

    // The derivative of the state under the forces of held contacts; the next call reuses the array.
    function derivative(t, y) {
      if (!steps.press(law, now, t, y)) throw unheld();
      return now.found.subarray(0, states);
    }

    // Go from t to the end of a step that was made, or to the first event in it, in which contacts strike or are let go:
    // `reached` takes the time there, also if this fails. What happened; null if nothing did.
    function ended(way, t, end, reached) {
      at.t = t;
      try {
        return eventsOf(() => steps.ended(law, way, now, {}, at, end, 1));
      } finally {
        reached(at.t);
      }
    }

    // Let go contacts whose effects are switched off.
    function release(t) {
      const off = held().filter((k) => !active(k));
      at.t = t;
      if (off.length) steps.release(law, now, t, y, Int32Array.from(all, (k) => off.includes(k)));
      return off.map(event("lift"));
    }

    return { held, begin, derivative, ended, release };
  }

  return { make };
})();

// `makeSharing`: the address of the page as it is now, and the page as an address says.

const makeSharing = ({ engine, panels, plotting, comparison, current, begin, setMode, showKept }) => {
  const byName = (quantities, given, own) => Float64Array.from(quantities, ({ name }, k) => given.get(name) ?? own(k));

  function address() {
    const { t, y, p, u } = current();
    const setup = {
      parameters: links.changed(DATA.parameters, p), inputs: links.changed(DATA.inputs, u), state: links.changed(DATA.states, y),
      t, method: engine.method, dt: engine.dt, plots: plotting.plots.specs(),
    };
    const kept = comparison.engine;
    if (kept) {
      setup.kept = {
        parameters: links.changed(DATA.parameters, kept.p), inputs: links.changed(DATA.inputs, kept.u),
        state: links.changed(DATA.states, comparison.given(t)[1]), method: kept.method, dt: kept.dt,
      };
    }
    return links.write(setup);
  }

  const known = (method) => (engine.methods.some(({ name }) => name === method) ? method : engine.method);
  const stateOf = (given, y) => byName(DATA.states, given, (k) => y[k]);

  // The page as an address says. Returns whether it says anything.
  function open(hash) {
    const given = links.read(hash);
    if (!given) return false;
    setMode("live");
    given.parameters.forEach((x, name) => panels.setParameter(name, x));
    given.inputs.forEach((x, name) => panels.setInput(name, x));
    if (given.method) engine.setMethod(known(given.method), given.dt);
    panels.showMethods(engine);
    begin((y) => y.set(stateOf(given.state, y)), given.t);
    if (given.kept) {
      const { parameters, inputs, state, method, dt } = given.kept;
      const value = (table) => (k) => table[k].value;
      comparison.keep({
        p: byName(DATA.parameters, parameters, value(DATA.parameters)), u: byName(DATA.inputs, inputs, value(DATA.inputs)),
        method: known(method), dt: dt ?? engine.dt,
      }, stateOf(state, Float64Array.from(DATA.initial)), engine.t);
      showKept();
    }
    if (given.plots.length) plotting.restore(given.plots);
    return true;
  }

  const link = tools.byId("link");
  link.addEventListener("click", async () => {
    const { href } = new URL(address(), location.href);
    let told = "A frame has no address";
    try {
      history.replaceState(null, "", href);
      told = "It is in the address bar";
      await navigator.clipboard.writeText(href);
      told = "Copied";
    } catch {
      // not allowed here
    }
    link.textContent = told;
    setTimeout(() => {
      link.textContent = "Copy link";
    }, 2000);
  });
  return { open };
};

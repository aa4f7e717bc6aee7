// `links` writes what was set by hand after the # of the page's address, and reads it back. All of it is by name, so that a
// link keeps its meaning where the page has changed; what is not known there, or no finite number, is left out.

const links = (() => {
  const MARK = "#live=";
  // Values by the names of quantities {name, value}, without those that are as the page has them.
  const changed = (quantities, values) =>
    Object.fromEntries(quantities.map(({ name, value }, k) => [name, values[k], value]).filter(([, x, own]) => x !== own));
  const numbersIn = (given) => new Map(Object.entries(given ?? {}).filter(([, x]) => Number.isFinite(x)));
  const isText = (x) => typeof x === "string";

  const setupIn = ({ parameters, inputs, state, method, dt }) => ({
    parameters: numbersIn(parameters), inputs: numbersIn(inputs), state: numbersIn(state),
    method: isText(method) ? method : "", dt: dt > 0 && dt < Infinity ? dt : undefined,
  });

  // What an address says of {parameters, inputs, state}, each numbers by name, of t, method, dt, and plots {x, y}; `kept` is
  // the same of a second run, or null. Null if it says nothing.
  function read(hash) {
    if (!hash.startsWith(MARK)) return null;
    try {
      const { t, plots, kept, ...setup } = JSON.parse(decodeURIComponent(hash.slice(MARK.length)));
      const shown = (Array.isArray(plots) ? plots : []).filter(({ x, y }) => (x === null || isText(x)) && Array.isArray(y) && y.every(isText));
      return { ...setupIn(setup), t: Number.isFinite(t) ? t : 0, plots: shown, kept: kept && typeof kept === "object" ? setupIn(kept) : null };
    } catch {
      return null;
    }
  }
  const write = (setup) => `${MARK}${encodeURIComponent(JSON.stringify(setup))}`;
  return { read, write, changed };
})();

// `makeEquations`: the equations of motion beside the picture, each term named by its effect and with its value. A term is a
// button that lights its effect up: `onLight(name or null)`. Null where there are no terms.

const makeEquations = (terms, onLight) => {
  const { byId, element } = tools;
  const MOST = 12; // coordinates whose equations are shown at once; of more, one that is chosen
  const PAUSE = 120; // ms between changes of the numbers while it plays
  const DOTS = ["", "\u0307", "\u0308"];
  if (!terms) return null;
  const panel = byId("equations-panel");
  const list = byId("equations");
  let [written, lit] = [-Infinity, null];

  // A rate as people write it, such as θ with two dots and its subscript.
  function rate(j) {
    const { letter, dots, below } = DATA.rates[j];
    return [letter.length > 1 ? `${letter}${["", "˙", "¨"][dots]}` : letter + DOTS[dots], ...(below ? [element("sub", {}, below)] : [])];
  }
  const plain = ({ letter, below }) => letter + (below ? `_${below}` : "");
  const named = ({ kind, name, j }, i) => (kind === "inertia" ? ["M", element("sub", {}, `${i + 1}${terms.n > 9 ? "," : ""}${j + 1}`), " ", ...rate(j)] : [name]);

  function summand(term, i, sign) {
    const value = element("output", { class: "value" });
    const bar = element("i", { class: "part" });
    const content = [element("span", {}, ...named(term, i)), value, bar];
    const isEffect = term.kind === "effect";
    const box = isEffect ? element("button", { type: "button", class: "term", "data-effect": term.name, "aria-pressed": "false" }, ...content)
      : element("span", { class: `term ${term.kind}` }, ...content);
    if (isEffect) box.addEventListener("click", () => onLight(lit === term.name ? null : term.name));
    const whole = element("span", { hidden: true }, element("span", { class: "sign" }, sign), box);
    return { whole, value, bar };
  }

  // One equation, whose terms appear once they are not 0.
  function equation(i) {
    const root = element("div", { class: "equation", role: "group", "aria-label": `Equation of ${plain(DATA.rates[i])}, ${terms.units[i]}` });
    const cells = [];
    let scale = 0;
    list.append(root);
    return (state, rates, playing) => {
      const found = terms.at(i, state, rates);
      if (!cells.length) {
        const first = found.findIndex(({ kind }) => kind !== "inertia");
        found.forEach((term, k) => cells.push(summand(term, i, k === first ? "=" : k ? "+" : "")));
        root.append(...cells.map(({ whole }) => whole), element("span", { class: "unit" }, numbers.unit(terms.units[i])));
        light(lit);
      }
      const most = Math.max(...found.map(({ value }) => Math.abs(value)).filter(Number.isFinite), 0);
      scale = playing ? Math.max(0.95 * scale, most) : most; // bars that jump could not be read
      let before = false; // whether a term of this side is shown
      found.forEach(({ kind, value, j }, k) => {
        const { whole, value: cell, bar } = cells[k];
        const needed = value !== 0 || kind === "velocity" || j === i;
        if (needed) whole.hidden = false;
        if (kind === "velocity") before = false;
        whole.firstChild.textContent = kind === "velocity" ? "=" : before ? "+" : "";
        before ||= !whole.hidden;
        cell.textContent = numbers.text(value, "", scale);
        bar.style.width = `${scale > 0 ? (100 * Math.abs(value)) / scale : 0}%`;
        bar.dataset.sign = value < 0 ? "−" : "+";
      });
    };
  }

  let rows = [];
  function choose(indices) {
    list.replaceChildren();
    rows = indices.map(equation);
    written = -Infinity;
  }
  if (terms.n > MOST) {
    const select = element("select", { id: "equation-of" }, ...DATA.rates.map((x, i) => element("option", { value: i }, plain(x))));
    select.addEventListener("change", () => {
      choose([Number(select.value)]);
      onLight(lit);
    });
    list.before(element("p", { class: "choice" }, element("label", { for: "equation-of" }, "Coordinate"), select));
    choose([0]);
  } else choose([...Array(terms.n).keys()]);
  panel.hidden = false;
  panel.open = terms.n <= MOST / 2;

  function light(name) {
    lit = name;
    for (const button of list.querySelectorAll("button.term")) button.setAttribute("aria-pressed", String(button.dataset.effect === name));
  }

  return {
    light,
    // Write the terms at a state; `ratesOf()` is its time derivative, null where it is not known.
    show(state, ratesOf, playing) {
      const now = performance.now();
      if (!panel.open || (playing && now - written < PAUSE)) return;
      written = now;
      const rates = ratesOf();
      for (const write of rows) write(state, rates, playing);
      byId("equations-note").hidden = Boolean(rates);
    },
  };
};

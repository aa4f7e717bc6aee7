// `makeValues`: the tables of states and energies. A state can be typed where the motion can be live: `typed(index, value)`.

const makeValues = (typed) => {
  const { byId, element } = tools;
  const MANY = 24; // tables with more values than this are written a few times a second while it plays
  const PAUSE = 150; // ms

  function row(table, name, unit, color) {
    const value = element("td");
    const head = element("th", { scope: "row" });
    if (color) head.append(element("span", { class: "swatch", "data-color": color }));
    head.append(name);
    byId(table).tBodies[0].append(element("tr", { "data-name": name }, head, value, element("td", { class: "unit" }, numbers.unit(unit))));
    return value;
  }
  const time = row("energies", "time", "s");
  const energies = ["kinetic", "potential", "total"].map((name) => row("energies", name, "J", name));
  const drift = row("energies", DATA.keepsEnergy ? "drift of the total" : "change of the total", "J");
  const cost = DATA.live ? row("energies", "time of a step", "ms") : null;
  const states = DATA.states.map(({ name, unit }, k) => {
    const cell = row("values", name, unit);
    return DATA.live ? field(cell, name, unit, k) : cell;
  });
  let shown = [];

  // The field of a state. While it is typed in, the motion does not write over it.
  function field(cell, name, unit, k) {
    const box = element("input", {
      type: "text", inputmode: "decimal", class: "field", spellcheck: "false", autocomplete: "off",
      "aria-label": unit ? `${name}, ${unit}` : name, title: "Type a value to go on from there",
    });
    box.addEventListener("focus", () => {
      box.value = `${shown[k]}`;
      box.select();
    });
    box.addEventListener("change", () => {
      const value = Number(box.value.trim().replace(",", ".").replace("−", "-"));
      const isNumber = box.value.trim() !== "" && Number.isFinite(value);
      box.classList.toggle("wrong", !isNumber);
      if (!isNumber) return;
      box.blur();
      typed(k, value);
    });
    box.addEventListener("blur", () => box.classList.remove("wrong"));
    cell.append(box);
    return {
      set textContent(text) {
        if (document.activeElement !== box) box.value = text;
      },
    };
  }
  let [written, scale, start] = [-Infinity, 0, null];

  return {
    // Energies are compared with the total at the start from now on.
    restart: () => {
      start = null;
      scale = 0;
    },
    show({ t, y, energy, playing, stepCost, single }) {
      const now = performance.now();
      if (playing && states.length > MANY && now - written < PAUSE) return;
      written = now;
      shown = y;
      time.textContent = numbers.text(t, "", 1);
      states.forEach((cell, k) => {
        cell.textContent = numbers.text(y[k], "", 1);
      });
      const { kinetic, potential } = energy;
      const total = kinetic + potential;
      start ??= total;
      scale = Math.max(scale, Math.abs(kinetic), Math.abs(potential));
      [kinetic, potential, total].forEach((value, k) => {
        energies[k].textContent = numbers.text(value, "", scale);
      });
      // States that are stored in single precision give rounding, which is no drift.
      drift.textContent = numbers.text(total - start, "", single ? 1e6 * scale : 1e-3 * scale);
      if (cost) cost.textContent = Number.isFinite(stepCost) ? numbers.text(stepCost) : "–";
    },
  };
};

// `makePoses`: while the motion stands, a slider for each independent coordinate of the joints: `pose(k, value)` gives state k a
// value. A slider reaches to the stops of its joint, or once round, or as far as the mechanism is large.

const makePoses = (mechanism, pose) => {
  const { byId, element } = tools;
  const MOST_OPEN = 6;
  const { states, initial } = DATA;
  const TURN = 2 * Math.PI;
  const velocities = [...states.keys()].filter((k) => states[k].kind === "velocity");
  const own = states.map(({ name, kind }, k) => ({ k, rate: kind === "position" ? velocities.findIndex((v) => states[v].name === `${name}_dot`) : -1 }))
    .filter(({ rate }) => rate >= 0);

  // How constraints change with each velocity: the columns of their Jacobian at the start.
  function columns() {
    const given = [DATA.parameters, DATA.inputs].map((table) => Float64Array.from(table, ({ value }) => value));
    const rates = (i) => {
      const y = Float64Array.from(initial);
      velocities.forEach((k, j) => (y[k] = Number(j === i)));
      return Array.from(mechanism.constraintRates(0, y, ...given));
    };
    const rest = rates(-1);
    return velocities.map((_, i) => rates(i).map((x, r) => x - rest[r]));
  }

  // The coordinates that do not follow from those before them: the later ones make way.
  function independent() {
    if (!mechanism.constraintRates) return own;
    const basis = [];
    const all = columns();
    const follows = ({ rate }) => {
      const column = [...all[rate]];
      const size = Math.hypot(...column);
      for (const { pivot, unit } of basis) {
        const part = column[pivot];
        column.forEach((_, r) => (column[r] -= part * unit[r]));
      }
      const pivot = column.reduce((best, x, r) => (Math.abs(x) > Math.abs(column[best]) ? r : best), 0);
      if (!(Math.abs(column[pivot]) > 1e-9 * size)) return false;
      basis.push({ pivot, unit: column.map((x) => x / column[pivot]) });
      return true;
    };
    const dependent = new Set([...own].reverse().filter(follows));
    return own.filter((each) => !dependent.has(each));
  }

  const rows = independent().map(({ k }) => {
    const { name, unit } = states[k];
    const turns = unit === "rad" && !DATA.limits?.[name];
    const reach = turns ? Math.PI : DATA.size ?? 1;
    const [low, high] = [0, 1].map((end) => DATA.limits?.[name]?.[end] ?? initial[k] + (end ? reach : -reach));
    const id = `pose-${name}`;
    const slider = element("input", { type: "range", id, min: low, max: high, step: "any" });
    const value = element("output", { for: id });
    let whole = 0; // turns that the slider leaves out
    slider.addEventListener("input", () => pose(k, Number(slider.value) + TURN * whole));
    slider.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (!way) return;
      event.preventDefault();
      slider.value = Number(slider.value) + (way * (high - low)) / 100;
      slider.dispatchEvent(new Event("input"));
    });
    byId("poses").append(element("div", { class: "quantity" }, element("label", { for: id }, name), slider, value, element("span", { class: "unit" }, numbers.unit(unit))));
    return (y) => {
      whole = turns ? Math.round((y[k] - initial[k]) / TURN) : 0;
      if (slider.matches(":active")) value.textContent = numbers.text(Number(slider.value) + TURN * whole, "", 1);
      else {
        slider.value = y[k] - TURN * whole;
        value.textContent = numbers.text(y[k], "", 1);
      }
      slider.setAttribute("aria-valuetext", numbers.text(y[k], unit, 1));
    };
  });
  byId("poses-panel").hidden = !rows.length;
  byId("poses-panel").open = rows.length <= MOST_OPEN;

  return {
    show(y, playing) {
      byId("poses").disabled = playing;
      if (!playing && byId("poses-panel").open) for (const write of rows) write(y);
    },
  };
};

// `makePanels`: what is set by hand: parameters, inputs, effects, method and step. Every row has a
// label, a slider and a field for any value.

const makePanels = (actions) => {
  const { byId, element } = tools;
  const REACH = 4; // a slider reaches from the default divided by this to the default times this
  const own = DATA.parameters.map((parameter, index) => ({ ...parameter, index }));
  const switches = new Set(DATA.effects.map((effect) => effect.switch));
  const shown = own.filter(({ index }) => !switches.has(index));
  const inputs = DATA.inputs.slice(0, DATA.pointer ? DATA.pointer.first : undefined)
    .map((input, index) => ({ ...input, index }));

  // How a slider's place, -1 to 1, becomes a value: by a factor, so that a value keeps its sign; if
  // the default is 0, by a multiple of 10.
  const scaleOf = (base) => (base === 0
    ? { at: (place) => 10 * place, place: (x) => x / 10 }
    : { at: (place) => base * REACH ** place, place: (x) => (x / base > 0 ? Math.log(x / base) / Math.log(REACH) : -1) });

  const plain = (x) => `${Number(x.toPrecision(6))}`; // as it is typed

  function rows(kind, quantities, set) {
    const list = byId(kind);
    return quantities.map((quantity) => {
      const { name, unit, about, value } = quantity;
      const id = `${kind}-${name}`;
      const scale = scaleOf(value);
      const slider = element("input", {
        type: "range", id, min: -1, max: 1, step: 0.01, "data-name": name, "aria-label": about ? `${name}, ${about}` : name,
      });
      const field = element("input", {
        type: "text", inputmode: "decimal", class: "field", spellcheck: "false", autocomplete: "off",
        "aria-label": unit ? `Value of ${name}, ${unit}` : `Value of ${name}`,
      });
      const reset = element("button", { type: "button", class: "undo", "aria-label": `Reset ${name}`, title: "Reset" }, "↺");
      const write = (x) => {
        field.value = plain(x);
        field.classList.remove("wrong");
        reset.disabled = x === value;
        slider.setAttribute("aria-valuetext", numbers.short(x, unit));
      };
      const change = (x) => {
        slider.value = scale.place(x); // beyond its ends it stays there
        write(x);
        set(quantity.index, x);
      };
      slider.addEventListener("input", () => {
        const x = scale.at(Number(slider.value));
        write(x);
        set(quantity.index, x);
      });
      field.addEventListener("change", () => {
        const typed = Number(field.value.trim().replace(",", ".").replace("−", "-"));
        if (field.value.trim() !== "" && Number.isFinite(typed)) change(typed);
        else field.classList.add("wrong");
      });
      reset.addEventListener("click", () => change(value));
      slider.value = scale.place(value);
      write(value);
      list.append(element("div", { class: "quantity", title: about || name },
        element("label", { for: id }, name), slider, field, element("span", { class: "unit" }, numbers.unit(unit)), reset));
      return { restore: () => change(value), name, change };
    });
  }

  const parameterRows = rows("parameters", shown, (index, x) => actions.parameter(index, x));
  const inputRows = rows("inputs", inputs, (index, x) => actions.input(index, x));
  byId("parameters-panel").hidden = !DATA.live || !shown.length;
  byId("inputs-panel").hidden = !DATA.live || !inputs.length;
  byId("reset-parameters").addEventListener("click", () => parameterRows.forEach((row) => row.restore()));

  // ---- Effects ----

  const total = DATA.operations || 1;
  const effectBoxes = DATA.effects.filter((effect) => effect.switch !== null).map((effect) => {
    const id = `effect-${effect.name}`;
    const box = element("input", { type: "checkbox", id, "data-name": effect.name, checked: true });
    const share = Math.round((100 * effect.operations) / total);
    const cost = effect.operations > 0 ? `${share || "< 1"} % of the arithmetic` : "costs nothing";
    const set = () => actions.parameter(effect.switch, box.checked ? 1 : 0);
    box.dataset.switch = own[effect.switch].name;
    box.setChecked = (checked) => {
      box.checked = checked;
      set();
    };
    box.addEventListener("change", set);
    const kind = effect.type === effect.name ? "" : `${effect.type.replace(/_/g, " ")} · `;
    const about = element("span", { class: "faint" }, ` ${kind}${cost}`);
    byId("effects").append(element("div", { class: "effect" }, box, element("label", { for: id }, effect.name, about)));
    return box;
  });
  byId("effects-panel").hidden = !DATA.live || !effectBoxes.length;
  byId("effects-total").textContent = "Beside each effect: how much less is to be computed without it.";

  // ---- Method and step ----

  const [method, step] = [byId("method"), byId("step-size")];
  byId("method-panel").hidden = !DATA.live;
  const setMethod = () => {
    const typed = Number(step.value.trim().replace(",", "."));
    const wrong = !(typed > 0 && Number.isFinite(typed));
    step.classList.toggle("wrong", wrong);
    if (!wrong) actions.method(method.value, typed / 1000);
  };
  method.addEventListener("change", setMethod);
  step.addEventListener("change", setMethod);
  byId("step-half").addEventListener("click", () => {
    step.value = plain(Number(step.value) / 2);
    setMethod();
  });
  byId("step-double").addEventListener("click", () => {
    step.value = plain(Number(step.value) * 2);
    setMethod();
  });

  return {
    showMethods(engine) {
      method.replaceChildren(...engine.methods.map(({ name, about }) => element("option", { value: name }, `${name}: ${about}`)));
      method.value = engine.method;
      step.value = plain(engine.dt * 1000);
    },
    setParameter(name, x) {
      parameterRows.find((row) => row.name === name)?.change(x);
      effectBoxes.find((box) => box.dataset.switch === name)?.setChecked(x !== 0);
    },
    setInput: (name, x) => inputRows.find((row) => row.name === name)?.change(x),
  };
};

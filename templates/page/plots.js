// `makePlots` fills an element with plots of channels against time or against one another, in step
// with the picture. Options: onSeek(t) moves the picture; onPut(k, value) gives
// state k a value, if a motion can go on from there; name is the start of names of files.

const makePlots = (container, channels, { onSeek = () => {}, onPut = null, name = "plot" } = {}) => {
  const MOST_SAMPLES = 6000; // of a live run within the time shown
  const SPANS = [2, 5, 10, 30, 60]; // seconds of a live run that are shown
  const CURVES = 8; // colours; more curves are dashed
  const FIRST = 6; // plots of states that a page begins with; the states of larger mechanisms are under + Plot
  const DASHES = [[], [6, 4], [2, 3]];
  const READING = 100; // ms between changes of the numbers while the picture moves
  const LEAST_PAUSE = 50; // ms between two drawings of a live run

  const samples = makeSamples(channels);
  const state = { kept: null, live: false, span: SPANS[2], view: null, mark: 0, hover: null };
  const due = { data: false, mark: false, frame: 0, drawn: 0, took: 0, read: 0, timer: 0 };
  let plots = [];
  let colors = new Map();

  const make = plotElement;
  // Who says what a button shows must reach it: its name has its words.
  const named = (text, label) => (text.length === 1 || label.toLowerCase().includes(text.toLowerCase()) ? label : `${text}: ${label}`);
  function button(text, label, act, className = "small") {
    const element = make("button", className, text);
    element.type = "button";
    if (label) Object.assign(element, { title: label, ariaLabel: named(text, label) });
    element.addEventListener("click", act);
    return element;
  }

  container.classList.add("plots");
  const bar = container.appendChild(make("div", "plots-bar"));
  const body = container.appendChild(make("div", "plots-list"));
  const note = make("span", "plots-note");
  note.setAttribute("role", "status");
  const spanField = make("label", "", "Last");
  const spanSelect = spanField.appendChild(make("select"));
  for (const span of SPANS) spanSelect.append(new Option(`${span} s`, span, false, span === state.span));
  spanSelect.addEventListener("change", () => {
    state.span = Number(spanSelect.value);
    setMemory();
    look(null);
  });
  const whole = button("Whole time", "Show the whole time (0, or a double click)", () => look(null));
  bar.append(
    button("+ Plot", "Add a plot", () => choose(null)),
    button("+ Phase portrait", "Plot a velocity against its position", () => seen(addPlot(portrait()))),
    spanField, whole, note,
  );
  const picker = makePicker(container, channels);

  // ---- Colours of the theme ----

  const probe = container.appendChild(make("span"));
  probe.hidden = true;
  function paint(css) {
    if (!colors.has(css)) {
      probe.style.color = css;
      colors.set(css, getComputedStyle(probe).color);
    }
    return colors.get(css);
  }
  const colorName = (plot, key) => channels.get(key).color ?? `var(--curve-${1 + (plot.slots.get(key) % CURVES)})`;
  const dashOf = (plot, key) => DASHES[Math.min(Math.floor(plot.slots.get(key) / CURVES), DASHES.length - 1)];

  // ---- Time ----

  function setMemory() {
    for (const each of [samples, ...(state.kept ? [state.kept] : [])]) {
      each.span = state.live ? state.span : Infinity;
      each.spacing = state.live ? state.span / MOST_SAMPLES : 0;
    }
  }
  function bounds() {
    const t = samples.times();
    const [first, last] = t.length ? [t[0], t[t.length - 1]] : [0, 1];
    if (!state.live) return last > first ? [first, last] : [first, first + 1];
    const low = Math.max(first, last - state.span);
    return [low, Math.max(last, low + state.span)];
  }
  const view = () => state.view ?? bounds();
  function setLive(live) {
    const other = state.kept && state.live !== live;
    state.live = live;
    setMemory();
    if (other) for (const plot of plots) build(plot); // with or without the curves of the kept run
  }

  function look(next) {
    if (next) {
      const [low, high] = bounds();
      const least = 1e-9 * Math.max(high - low, Math.abs(high));
      if (!(next[1] - next[0] > least)) return;
      state.view = next[0] <= low && next[1] >= high ? null : next;
    } else state.view = null;
    whole.hidden = !state.view;
    change("data");
  }
  function seek(t) {
    const all = samples.times();
    if (!all.length) return;
    const to = Math.min(Math.max(t, all[0]), all[all.length - 1]);
    api.cursor(to);
    onSeek(to);
  }
  function step(count) {
    const t = samples.times();
    if (!t.length) return;
    let index = samples.before(state.mark);
    if (count < 0 && t[index] < state.mark) index += 1;
    index = Math.min(Math.max(index + count, 0), t.length - 1);
    while (count > 0 && index < t.length - 1 && t[index] <= state.mark) index += 1; // at impacts times repeat
    while (count < 0 && index > 0 && t[index] >= state.mark) index -= 1;
    seek(t[index]);
  }
  const end = (direction) => seek(direction * Infinity);

  // ---- Plots ----

  const place = (plot) => ({
    box: plot.box,
    samples,
    kept: state.live ? state.kept : null,
    put: (x, y) => [[plot.spec.x, x], [plot.spec.y[0], y]].forEach(([key, value]) => onPut(channels.states.indexOf(key), value)),
    isPutting: () => plot.putting,
    spec: plot.spec,
    channel: channels.get,
    color: (key) => paint(colorName(plot, key)),
    dash: (key) => dashOf(plot, key),
    paint,
    view,
    mark: () => state.mark,
    hover(t) {
      state.hover = t;
      for (const other of plots) other.chart?.hover(t);
      read();
    },
    seek,
    look,
    step,
    end,
  });

  // Whether a curve can join a plot: two units against time, one against another channel.
  function joins(plot, key) {
    const units = new Set([...plot.spec.y, key].map((k) => channels.get(k).unit));
    return units.size <= (plot.spec.x ? 1 : 2);
  }

  function setPutting(plot, putting) {
    plot.putting = putting;
    plot.putter.setAttribute("aria-pressed", String(putting));
  }

  function addPlot({ x = null, y }) {
    const plot = { spec: { x, y: [] }, slots: new Map(), chart: null, readers: [] };
    plot.root = make("section", "plot");
    plot.curves = plot.root.appendChild(make("ul", "plot-curves"));
    const tools = make("div", "plot-tools");
    plot.putter = button("Set state", "Click or drag a point, or press arrow keys, to go on from there", () => setPutting(plot, !plot.putting), "small bare");
    tools.append(
      plot.putter,
      button("Curves", "Add or remove curves", () => choose(plot), "small bare"),
      button("x axis", "Choose what lies along the horizontal axis", () => chooseAcross(plot), "small bare"),
      button("PNG", "Save this plot as a picture", () => savePicture(plot), "small bare"),
      button("SVG", "Save this plot as a vector graphic", () => saveVectors(plot), "small bare"),
      button("×", "Remove this plot", () => removePlot(plot), "small bare"),
    );
    plot.box = plot.root.appendChild(make("div", "plot-box"));
    plot.box.tabIndex = 0;
    plot.box.setAttribute("role", "group");
    const foot = plot.root.appendChild(make("div", "plot-foot"));
    plot.foot = foot.appendChild(make("span"));
    foot.append(tools);
    plot.watch = new ResizeObserver(() => plot.chart?.resize());
    plot.watch.observe(plot.box);
    body.append(plot.root);
    plots.push(plot);
    for (const key of y) if (channels.get(key)) toggle(plot, key, false);
    build(plot);
    return plot;
  }

  function seen(plot) {
    plot.root.scrollIntoView({ block: "nearest" });
    return plot;
  }

  // A position and its velocity which are not shown yet, if there are such.
  function portrait() {
    const { pairs } = channels;
    const [x, y] = pairs.find((pair) => !plots.some(({ spec }) => spec.x === pair[0])) ?? pairs[0] ?? [];
    return x ? { x, y: [y] } : { x: channels.list[0].key, y: [channels.list[Math.max(0, channels.states.length - 1)].key] };
  }

  function removePlot(plot) {
    plot.watch.disconnect();
    plot.chart?.destroy();
    plot.root.remove();
    plots = plots.filter((other) => other !== plot);
    forget();
  }
  const forget = () => samples.keepOnly(new Set(plots.flatMap(({ spec }) => [...spec.y, ...(spec.x ? [spec.x] : [])])));

  // Add or remove a curve; what does not fit by its unit gets a plot of its own.
  function toggle(plot, key, andBuild = true) {
    if (plot.spec.y.includes(key)) {
      plot.spec.y = plot.spec.y.filter((other) => other !== key);
      plot.slots.delete(key);
    } else if (!joins(plot, key)) {
      note.textContent = `${channels.get(key).label} has another unit and got a plot of its own.`;
      seen(addPlot({ y: [key] }));
      return;
    } else {
      const taken = new Set(plot.slots.values());
      let slot = 0;
      while (taken.has(slot)) slot += 1;
      plot.slots.set(key, slot);
      plot.spec.y.push(key);
    }
    if (andBuild) build(plot);
  }

  function swatch(plot, key) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    const line = svg.appendChild(document.createElementNS(svg.namespaceURI, "line"));
    svg.setAttribute("viewBox", "0 0 20 8");
    svg.setAttribute("aria-hidden", "true");
    for (const [attribute, value] of Object.entries({ x1: 0, x2: 20, y1: 4, y2: 4, "stroke-width": 3 })) line.setAttribute(attribute, value);
    line.style.stroke = colorName(plot, key);
    line.style.strokeDasharray = dashOf(plot, key).join(" ");
    return svg;
  }

  // Whether a plot is the phase plane of a coordinate.
  const isPlane = ({ x, y }) => channels.pairs.some(([position, rate]) => position === x && y.length === 1 && y[0] === rate);

  function build(plot) {
    plot.putter.hidden = !onPut || !isPlane(plot.spec);
    if (plot.putter.hidden) setPutting(plot, false);
    plot.chart?.destroy();
    plot.chart = null;
    plot.readers = [];
    plot.curves.replaceChildren();
    for (const key of plot.spec.y) {
      const item = plot.curves.appendChild(make("li"));
      const value = make("span", "plot-value");
      const { label } = channels.get(key);
      item.append(swatch(plot, key), make("span", "plot-name", label), value,
        button("×", `Remove ${label}`, () => toggle(plot, key), "small bare"));
      plot.readers.push({ key, value });
    }
    const across = plot.spec.x ? channels.get(plot.spec.x).label : "time";
    const names = plot.spec.y.map((key) => channels.get(key).label).join(", ");
    plot.box.setAttribute("aria-label", `${names || "No curve"} against ${across}. ` +
      "Left and right move the time, plus and minus zoom, Shift and arrows move the plot, 0 shows all.");
    if (plot.spec.y.length) plot.chart = (plot.spec.x ? charts.phase : charts.time)(place(plot));
    else plot.foot.textContent = "Choose what to show with Curves.";
    forget();
    change("data");
  }

  function choose(plot) {
    let target = plot;
    picker.open(plot ? "Curves of this plot" : "A new plot of", {
      many: true,
      isChosen: (key) => Boolean(target?.spec.y.includes(key)),
      choose(key) {
        note.textContent = "";
        if (target) toggle(target, key);
        else target = seen(addPlot({ y: [key] }));
      },
    });
  }

  function chooseAcross(plot) {
    picker.open("Along the horizontal axis", {
      extra: { key: null, label: "time" },
      isChosen: (key) => plot.spec.x === key,
      choose(key) {
        const units = new Set(plot.spec.y.map((k) => channels.get(k).unit));
        plot.spec.x = key;
        if (key && units.size > 1) {
          const kept = channels.get(plot.spec.y[0]).unit;
          plot.spec.y = plot.spec.y.filter((k) => channels.get(k).unit === kept);
          note.textContent = `Kept the curves in ${numbers.unit(kept)}.`;
        }
        build(plot);
      },
    });
  }

  // ---- Numbers beside the plots ----

  function read() {
    clearTimeout(due.timer);
    Object.assign(due, { read: performance.now(), timer: 0 });
    const time = state.hover ?? state.mark;
    for (const plot of plots) {
      if (!plot.chart) continue;
      const keys = plot.spec.x ? [...plot.spec.y, plot.spec.x] : plot.spec.y;
      const columns = samples.columns(keys);
      const text = (k) => numbers.text(samples.valueAt(columns[k], time), channels.get(keys[k]).unit, samples.scale(keys[k]));
      plot.readers.forEach(({ value }, k) => { value.textContent = text(k); });
      const last = plot.spec.x ? `, ${channels.get(plot.spec.x).label} = ${text(keys.length - 1)}` : "";
      plot.foot.textContent = `t = ${numbers.steady(time, "s", 1)}${last}`;
    }
  }

  // Numbers that change with every picture could not be read.
  function readSoon() {
    const wait = due.read + READING - performance.now();
    if (wait <= 0) read();
    else if (!due.timer) due.timer = setTimeout(read, wait);
  }

  function savePicture(plot) {
    if (!plot.chart) return;
    const source = plot.chart.canvas();
    const ratio = uPlot.pxRatio;
    const line = 18 * ratio;
    const picture = make("canvas");
    Object.assign(picture, { width: source.width, height: source.height + line * plot.spec.y.length + 6 * ratio });
    const pen = picture.getContext("2d");
    pen.fillStyle = paint("var(--card)");
    pen.fillRect(0, 0, picture.width, picture.height);
    pen.font = `${12 * ratio}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    plot.spec.y.forEach((key, k) => {
      const middle = 4 * ratio + line * (k + 0.5);
      pen.strokeStyle = paint(colorName(plot, key));
      pen.lineWidth = 2 * ratio;
      pen.setLineDash(dashOf(plot, key).map((x) => x * ratio));
      pen.beginPath();
      pen.moveTo(8 * ratio, middle);
      pen.lineTo(28 * ratio, middle);
      pen.stroke();
      pen.fillStyle = paint("var(--ink)");
      pen.fillText(channels.get(key).label, 34 * ratio, middle);
    });
    pen.drawImage(source, 0, picture.height - source.height);
    picture.toBlob((blob) => blob && downloads.save(`${downloads.fileName(`${name}_${plot.spec.y[0]}`)}.png`, blob));
  }

  function vectorsOf(plot) {
    const colors = { ink: "--ink", faint: "--faint", rule: "--rule", paper: "--card" };
    const looks = Object.fromEntries(Object.entries(colors).map(([key, name]) => [key, paint(`var(${name})`)]));
    const curves = plot.spec.y.map((key) => ({
      label: channels.get(key).label,
      color: paint(colorName(plot, key)),
      dash: dashOf(plot, key),
      series: 1 + plot.chart.keys.indexOf(key),
    }));
    return vectors.plot(plot.chart.plot(), curves, { ...looks, corners: plot.chart.corners(), title: name });
  }

  function saveVectors(plot) {
    if (!plot.chart) return;
    downloads.saveText(`${downloads.fileName(`${name}_${plot.spec.y[0]}`)}.svg`, vectorsOf(plot), "image/svg+xml");
  }

  // ---- Drawing, at most once a frame ----

  function change(what) {
    due[what] = true;
    if (!due.frame) due.frame = requestAnimationFrame(draw);
  }
  function draw(now) {
    due.frame = 0;
    if (!container.clientWidth) return; // hidden: `refresh` draws it when it is shown
    const pause = state.live ? Math.max(LEAST_PAUSE, 4 * due.took) : 0;
    if (due.data && now - due.drawn >= pause) {
      const from = performance.now();
      due.data = false;
      due.drawn = now;
      for (const { chart } of plots) {
        chart?.refresh();
        chart?.hover(state.hover);
      }
      due.took = performance.now() - from;
    } else if (due.mark) for (const plot of plots) plot.chart?.mark();
    due.mark = false;
    readSoon();
    if (due.data) change("data");
  }

  const api = {
    samples,
    // A run that is known whole; see `samples.set`.
    setSource(t, y, p, u, held, single) {
      setLive(false);
      samples.set(t, y, p, u, held, single);
      api.showLive();
    },
    // A live run, whose samples come by `append`.
    live() {
      setLive(true);
      samples.clear();
      api.showLive();
    },
    showLive() {
      spanField.hidden = !state.live;
      state.hover = null;
      look(null);
    },
    // Beside the curves those of another run, faint; null for none.
    compare(other) {
      state.kept = other;
      setMemory();
      for (const plot of plots) build(plot);
    },
    append(t, y, p, u, held) {
      if (samples.append(t, y, p, u, held)) change("data");
    },
    // The time of the picture.
    cursor(t) {
      state.mark = t;
      change("mark");
    },
    rowAt: samples.rowAt,
    // Plots as a list of {x: key or null, y: [keys]}.
    show(specs) {
      for (const plot of [...plots]) removePlot(plot);
      note.textContent = "";
      specs.forEach(addPlot);
    },
    specs: () => plots.map(({ spec }) => ({ x: spec.x, y: [...spec.y] })),
    // Each plot as SVG, and the box that it is drawn in.
    drawings: () => plots.filter(({ chart }) => chart).map((plot) => ({ box: plot.box, source: vectorsOf(plot) })),
    keys: () => [...new Set(plots.flatMap(({ spec }) => [...(spec.x ? [spec.x] : []), ...spec.y]))],
    // What to show at first: the states, in as few plots as they fit in, and the energies.
    first() {
      const shown = [];
      for (const { key, unit } of channels.list.filter((c) => c.group === "States")) {
        const last = shown.at(-1);
        if (last && last.length < CURVES && new Set([unit, ...last.map((k) => channels.get(k).unit)]).size <= 2) last.push(key);
        else shown.push([key]);
      }
      const energies = ["kinetic_energy", "potential_energy", "energy"].filter(channels.get);
      return [...shown.slice(0, FIRST), energies].filter((y) => y.length).map((y) => ({ x: null, y }));
    },
    // After a change of the theme, or when the panel was hidden.
    refresh() {
      colors = new Map();
      change("data");
    },
  };
  look(null);
  return api;
};

// `charts` draws curves with uPlot: `charts.time(place)` against time, `charts.phase(place)` one
// channel against another. What both need of the panel is in `place`:
//   box      element to draw in, which takes the focus
//   samples, spec {x, y: [keys]}, channel(key)
//   kept     samples of another run, whose curves are faint, or null
//   put(x, y), isPutting()   set the state to a place of a phase plane, and whether pointers and keys do so
//   color(key), dash(key), paint(css)   colours as the page's theme has them
//   view()   [from, to] of the time shown      mark()   time of the picture, s
//   hover(time or null), seek(time), look([from, to] or null), step(n), end(direction)
// Both return {keys, refresh(), mark(), hover(time), resize(), canvas(), destroy()}; `keys` are those of
// the curves in the order in which they are drawn.

const charts = (() => {
  const GAP = 0.06; // free part of a range beyond its curves
  const FLAT = 1e-6; // a relative change that is drawn as none
  const GRAB = 7; // CSS pixels around the time mark
  const NEAR = 10; // CSS pixels within which passes of an orbit are the same to a pointer
  const FONT = '12px system-ui, "Segoe UI", Roboto, "Liberation Sans", sans-serif';
  const FAINT = 0.4; // of the curves of another run
  const NUDGE = 0.02; // part of the range by which keys move a state
  const BENEATH = 4.4; // width of a curve below the others
  const HEIGHT = { time: 168, phase: 260 };

  // Limits of an axis for values from `low` to `high`.
  function rangeOf(low, high, scale) {
    if (!(low <= high) || !Number.isFinite(high - low)) return [-1, 1];
    const size = Math.max(Math.abs(low), Math.abs(high));
    if (size === 0 || numbers.isRounding(size, scale)) return [-1, 1];
    const gap = high - low <= FLAT * size ? 0.1 * size : GAP * (high - low);
    return [low - gap, high + gap];
  }

  function limits(values) {
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return [low, high];
  }

  // uPlot leaves a gap where there is no value, but joins over nan.
  const withGaps = (values) =>
    (values.every(Number.isFinite) ? values : Array.from(values, (value) => (Number.isFinite(value) ? value : null)));

  // What is drawn, in its order.
  const inOrder = ({ spec, channel }) => {
    const [below, above] = [true, false].map((is) => spec.y.filter((key) => channel(key).beneath === is));
    return { ...spec, y: [...below, ...above] };
  };
  const widthOf = (place, key, width) => (place.channel(key).beneath ? BENEATH : width);

  const scaleOf = (place, keys) => Math.min(...keys.map((key) => place.samples.scale(key)));

  // An axis; `exponents` receives the power of ten that its marks are in.
  function axis(place, scale, side, exponents, unit) {
    const across = side % 2 === 1;
    return {
      scale,
      side,
      font: FONT,
      stroke: () => place.paint("var(--faint)"),
      grid: { show: side !== 1, stroke: () => place.paint("var(--rule)"), width: 1 },
      ticks: { show: false },
      gap: 6,
      space: across ? 34 : 64,
      size: across ? (_, texts) => 14 + 7 * Math.max(2, ...(texts ?? []).map((text) => text.length)) : 24,
      values: (_, marks, __, ___, step) => {
        const { texts, exponent } = numbers.ticks(marks, step);
        exponents[scale] = exponent;
        if (!across && unit && texts.length) texts.push(`${texts.pop()}\u00a0${numbers.axisUnit(unit, exponent)}`);
        return texts;
      },
    };
  }

  // Write a text in the corner above an axis.
  function corner(u, place, text, onRight) {
    const { ctx } = u;
    ctx.save();
    ctx.font = FONT.replace("12px", `${12 * uPlot.pxRatio}px`);
    ctx.fillStyle = place.paint("var(--faint)");
    ctx.textAlign = onRight ? "right" : "left";
    ctx.textBaseline = "top";
    ctx.fillText(text, onRight ? ctx.canvas.width - 4 * uPlot.pxRatio : 4 * uPlot.pxRatio, 2 * uPlot.pxRatio);
    ctx.restore();
  }

  function child(parent, className) {
    const element = parent.appendChild(document.createElement("div"));
    element.className = className;
    element.hidden = true;
    return element;
  }

  const zoomed = ([low, high], factor, around) =>
    [around - (around - low) / factor, around + (high - around) / factor];

  // What charts of both kinds begin with, and what they can do.
  const options = (box, kind, onRight) => ({
    width: Math.max(box.clientWidth, 120),
    height: HEIGHT[kind],
    padding: [20, onRight ? 0 : 22, 0, 0],
    legend: { show: false },
  });
  const common = (u, box, kind) => ({
    resize: () => u.setSize({ width: Math.max(box.clientWidth, 120), height: HEIGHT[kind] }),
    canvas: () => u.ctx.canvas,
    plot: () => u,
    destroy: () => u.destroy(),
  });
  // Show the part that is chosen; once it is final, none.
  function showChosen(u, left, top, width, height, isFinal) {
    u.setSelect(isFinal ? { left: 0, top: 0, width: 0, height: 0 } : { left, top, width, height }, false);
    return isFinal;
  }

  // ---- Against time ----

  function time(place) {
    const { samples, box } = place;
    const spec = inOrder(place);
    const units = [...new Set(place.spec.y.map((key) => place.channel(key).unit))];
    const scaleName = (key) => `y${units.indexOf(place.channel(key).unit)}`;
    const exponents = {};
    const all = place.kept ? [...spec.y, ...spec.y] : spec.y;
    let chart = null;
    const keysOf = (name) => spec.y.filter((key) => scaleName(key) === name);
    const scales = { x: { time: false, range: () => place.view() } };
    units.forEach((_, i) => {
      scales[`y${i}`] = { range: (__, low, high) => rangeOf(low, high, scaleOf(place, keysOf(`y${i}`))) };
    });
    const u = new uPlot({
      ...options(box, "time", units.length > 1),
      scales,
      axes: [
        axis(place, "x", 2, exponents, "s"),
        ...units.map((_, i) => axis(place, `y${i}`, i ? 1 : 3, exponents)),
      ],
      series: [{}, ...all.map((key, k) => ({
        scale: scaleName(key),
        stroke: () => place.color(key),
        dash: place.dash(key),
        width: widthOf(place, key, 1.6),
        alpha: k < spec.y.length ? 1 : FAINT,
        points: { show: false },
      }))],
      cursor: {
        y: false,
        drag: { x: false, y: false },
        points: { size: 7 },
        bind: Object.fromEntries(["mousedown", "mouseup", "click", "dblclick", "mousemove", "mouseleave", "mouseenter"]
          .map((name) => [name, () => null])),
      },
      hooks: {
        draw: [
          (self) => units.forEach((unit, i) =>
            corner(self, place, numbers.axisUnit(unit, exponents[`y${i}`] ?? 0), i > 0)),
          () => chart?.mark(), // the size of the plot may be another one
        ],
      },
    }, [[], ...all.map(() => [])], box);
    const mark = child(u.over, "plot-mark");

    const timeAt = (x) => {
      const [low, high] = place.view();
      const at = low + ((high - low) * x) / Math.max(u.over.clientWidth, 1);
      return Math.min(Math.max(at, low), high);
    };
    const positionOf = (t) => {
      const [low, high] = place.view();
      return high > low ? (u.over.clientWidth * (t - low)) / (high - low) : 0;
    };
    chart = {
      ...common(u, box, "time"),
      keys: spec.y,
      refresh() {
        const times = samples.times();
        const other = place.kept?.columnsAt(spec.y, times) ?? [];
        u.setData([times, ...[...samples.columns(spec.y), ...other].map(withGaps)], true);
        chart.mark();
      },
      mark() {
        const x = positionOf(place.mark());
        mark.hidden = !(x >= -1 && x <= u.over.clientWidth + 1);
        mark.style.transform = `translateX(${x}px)`;
      },
      hover(t) {
        u.setCursor(t === null ? { left: -10, top: -10 } : { left: positionOf(t), top: 0 });
      },
      corners: () => units.map((unit, i) => numbers.axisUnit(unit, exponents[`y${i}`] ?? 0)),
    };
    plotGestures(u.over, box, {
      isMark: (x) => !mark.hidden && Math.abs(x - positionOf(place.mark())) <= GRAB,
      hover: (x) => place.hover(timeAt(x)),
      leave: () => place.hover(null),
      seek: (x) => place.seek(timeAt(x)),
      select(x0, _, x1, __, isFinal, finished = true) {
        const [left, right] = [Math.max(Math.min(x0, x1), 0), Math.min(Math.max(x0, x1), u.over.clientWidth)];
        if (!showChosen(u, left, 0, right - left, u.over.clientHeight, isFinal)) return;
        if (finished && right > left) place.look([timeAt(left), timeAt(right)]);
      },
      zoom: (factor, x) => place.look(zoomed(place.view(), factor, timeAt(x))),
      pan(dx) {
        const [low, high] = place.view();
        const shift = (-dx * (high - low)) / Math.max(u.over.clientWidth, 1);
        place.look([low + shift, high + shift]);
      },
      reset: () => place.look(null),
      step: place.step,
      end: place.end,
    });
    return chart;
  }

  // ---- One channel against another ----

  function phase(place) {
    const { samples, box } = place;
    const spec = inOrder(place);
    const exponents = {};
    let chart = null;
    let [xs, ys] = [[], []];
    let [keptX, keptY] = [[], []]; // of the kept run
    let zoom = null; // {x: [low, high], y: [low, high]}
    const scaleX = () => samples.scale(spec.x);
    const EMPTY = [Infinity, -Infinity];
    const widened = ([low, high], column) => {
      const [a, b] = limits(column);
      return [Math.min(low, a), Math.max(high, b)];
    };
    const whole = () => ({
      x: rangeOf(...[xs, keptX].reduce(widened, EMPTY), scaleX()),
      y: rangeOf(...[...ys, ...keptY].reduce(widened, EMPTY), scaleOf(place, spec.y)),
    });
    let shown = whole();

    function path(self, series) {
      const own = series <= ys.length;
      const [across, column] = own ? [xs, ys[series - 1]] : [keptX, keptY[series - 1 - ys.length]];
      const line = new Path2D();
      const { left, top, width, height } = self.bbox;
      const [kx, ky] = [width / (shown.x[1] - shown.x[0]), height / (shown.y[1] - shown.y[0])];
      let open = false;
      for (let i = 0; i < column.length; i += 1) {
        const x = left + kx * (across[i] - shown.x[0]);
        const y = top + height - ky * (column[i] - shown.y[0]);
        if (!Number.isFinite(x + y)) open = false;
        else if (open) line.lineTo(x, y);
        else {
          line.moveTo(x, y);
          open = true;
        }
      }
      return { stroke: line, fill: null, clip: null, band: null, gaps: null, flags: 1 };
    }

    const all = place.kept ? [...spec.y, ...spec.y] : spec.y;
    const unit = place.channel(spec.y[0]).unit;
    const nameOf = (key) => place.channel(key).label;
    const aboveAxis = () =>
      [spec.y.length === 1 ? nameOf(spec.y[0]) : "", numbers.axisUnit(unit, exponents.y0 ?? 0)].filter(Boolean).join(", ");
    const u = new uPlot({
      mode: 2,
      ...options(box, "phase", false),
      scales: { x: { time: false, range: () => shown.x }, y0: { range: () => shown.y } },
      axes: [
        { ...axis(place, "x", 2, exponents, place.channel(spec.x).unit), label: nameOf(spec.x), labelSize: 18, labelFont: FONT },
        axis(place, "y0", 3, exponents),
      ],
      series: [{}, ...all.map((key, k) => ({
        facets: [{ scale: "x", auto: true }, { scale: "y0", auto: true }],
        stroke: () => place.color(key),
        dash: place.dash(key),
        width: widthOf(place, key, 1.4),
        alpha: k < spec.y.length ? 1 : FAINT,
        paths: path,
      }))],
      cursor: { show: false },
      hooks: {
        draw: [
          (self) => corner(self, place, aboveAxis(), false),
          () => chart?.mark(),
        ],
      },
    }, [null, ...all.map(() => [[], []])], box);
    const dots = spec.y.map((key) => ({ key, mark: child(u.over, "plot-dot"), hover: child(u.over, "plot-dot plot-dot-hover") }));

    const across = () => u.over.clientWidth / (shown.x[1] - shown.x[0]);
    const down = () => u.over.clientHeight / (shown.y[1] - shown.y[0]);
    const pixel = (x, y) => [(x - shown.x[0]) * across(), (shown.y[1] - y) * down()];
    const value = (left, top) => [shown.x[0] + left / across(), shown.y[1] - top / down()];

    const current = () => { [xs, ...ys] = samples.columns([spec.x, ...spec.y]); };

    function putDots(name, t) {
      current(); // a live run goes on between two drawings
      dots.forEach((dot, k) => {
        const [left, top] = t === null || !xs.length ? [NaN, NaN]
          : pixel(samples.valueAt(xs, t), samples.valueAt(ys[k], t));
        const inside = left >= 0 && top >= 0 && left <= u.over.clientWidth && top <= u.over.clientHeight;
        dot[name].hidden = !inside;
        if (inside) dot[name].style.transform = `translate(${left}px, ${top}px)`;
        dot[name].style.background = place.color(dot.key);
      });
    }

    // The time at which the curves come nearest to a place; of several passes the one next to the mark.
    function nearestTime(left, top) {
      current();
      const [times, now] = [samples.times(), place.mark()];
      const [kx, ky] = [across(), down()];
      const [x, y] = value(left, top);
      const far = (i, k) => Math.hypot((xs[i] - x) * kx, (ys[k][i] - y) * ky);
      let [least, best] = [Infinity, null];
      for (let i = 0; i < times.length; i += 1) {
        for (let k = 0; k < ys.length; k += 1) if (far(i, k) < least) least = far(i, k);
      }
      for (let i = 0; i < times.length; i += 1) {
        for (let k = 0; k < ys.length; k += 1) {
          if (far(i, k) > least + NEAR) continue;
          if (best === null || Math.abs(times[i] - now) < Math.abs(times[best] - now)) best = i;
        }
      }
      return best === null ? null : times[best];
    }

    chart = {
      ...common(u, box, "phase"),
      keys: spec.y,
      refresh() {
        current();
        if (place.kept) [keptX, ...keptY] = place.kept.columns([spec.x, ...spec.y]);
        shown = zoom ?? whole();
        u.setData([null, ...ys.map((column) => [xs, column]), ...keptY.map((column) => [keptX, column])], true);
        chart.mark();
      },
      mark: () => putDots("mark", place.mark()),
      hover: (t) => putDots("hover", t),
      corners: () => [aboveAxis()],
    };
    function look(next) {
      zoom = next;
      chart.refresh();
    }
    // The state of a place. The axes stay as they are until the plot is reset.
    function put(left, top) {
      zoom ??= { x: [...shown.x], y: [...shown.y] };
      place.put(...value(left, top));
    }
    const seek = (left, top) => {
      if (place.isPutting()) {
        put(left, top);
        return;
      }
      const t = nearestTime(left, top);
      if (t !== null) place.seek(t);
    };
    plotGestures(u.over, box, {
      // By keys: by parts of the range, down if `dy` is positive.
      nudge(dx, dy) {
        if (!place.isPutting()) return false;
        current();
        const last = xs.length - 1;
        const [left, top] = pixel(xs[last], ys[0][last]);
        put(left + dx * NUDGE * u.over.clientWidth, top + dy * NUDGE * u.over.clientHeight);
        return true;
      },
      isMark: (x, y) => place.isPutting() || (!dots[0].mark.hidden && dots.some((_, k) => {
        const [left, top] = pixel(samples.valueAt(xs, place.mark()), samples.valueAt(ys[k], place.mark()));
        return Math.hypot(x - left, y - top) <= GRAB;
      })),
      hover: (x, y) => place.hover(place.isPutting() ? null : nearestTime(x, y)),
      leave: () => place.hover(null),
      seek,
      select(x0, y0, x1, y1, isFinal, finished = true) {
        const [left, right] = [Math.min(x0, x1), Math.max(x0, x1)];
        const [top, bottom] = [Math.min(y0, y1), Math.max(y0, y1)];
        if (!showChosen(u, left, top, right - left, bottom - top, isFinal)) return;
        const [[a, d], [b, c]] = [value(left, top), value(right, bottom)];
        if (finished && b > a && d > c) look({ x: [a, b], y: [c, d] });
      },
      zoom(factor, left, top) {
        const [x, y] = value(left, top);
        look({ x: zoomed(shown.x, factor, x), y: zoomed(shown.y, factor, y) });
      },
      pan(dx, dy) {
        const [sx, sy] = [-dx / across(), dy / down()];
        look({ x: shown.x.map((v) => v + sx), y: shown.y.map((v) => v + sy) });
      },
      reset: () => look(null),
      step: place.step,
      end: place.end,
    });
    return chart;
  }

  return { time, phase, rangeOf };
})();

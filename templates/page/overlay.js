// `makeOverlay`: what lies over the picture: scale bar, axes, and the legend of arrows.

const makeOverlay = (stage, show) => {
  const { byId, element, space } = tools;
  const STEP = 130; // pixels that the scale bar has at most
  const AXIS = 26; // pixels of an axis
  const AXES = [["x", [1, 0, 0]], ["y", [0, 1, 0]], ["z", [0, 0, 1]]].slice(0, DATA.dimensions);
  const SVG = "http://www.w3.org/2000/svg";
  const cross = AXES.map(([name]) => {
    const [line, text] = ["line", "text"].map((kind) => byId("axes").appendChild(document.createElementNS(SVG, kind)));
    line.setAttribute("class", `axis-${name}`);
    text.setAttribute("class", `axis-${name}`);
    text.textContent = name;
    return [line, text];
  });
  let seen = "";

  function drawAxes() {
    const [right, up] = stage.view.axes();
    AXES.forEach(([, axis], k) => {
      const [x, y] = [AXIS * tools.dot(right, axis), -AXIS * tools.dot(up, axis)];
      const [line, text] = cross[k];
      line.setAttribute("x2", x.toFixed(1));
      line.setAttribute("y2", y.toFixed(1));
      text.setAttribute("x", (1.35 * x).toFixed(1));
      text.setAttribute("y", (1.35 * y).toFixed(1));
      text.setAttribute("visibility", Math.hypot(x, y) < 4 ? "hidden" : "visible");
    });
  }

  function drawLegend(rows) {
    byId("legend").hidden = !rows.length;
    byId("legend").replaceChildren(...rows.map(({ kind, name, unit, color, value, pixels }) => {
      const bar = element("span", { class: "bar" });
      bar.style.width = `${pixels}px`;
      bar.style.background = color;
      return element("li", { "data-kind": kind }, bar, `${name} ${numbers.short(value, unit)}`);
    }));
  }

  return {
    draw() {
      const scale = stage.view.scale();
      const rows = stage.legend(show);
      const state = [scale, ...(space ? [stage.view.azimuth, stage.view.elevation] : []), ...rows.map(({ kind, value }) => kind + value)].join();
      if (state === seen) return;
      seen = state;
      const length = tools.roundLength(STEP / scale);
      byId("scale").style.width = `${length * scale}px`;
      byId("scale").textContent = numbers.short(length, "m");
      drawAxes();
      drawLegend(rows);
    },
  };
};

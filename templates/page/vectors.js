// `vectors` draws what the page shows as SVG: the picture by the corners of its faces and the ends of its
// lines, from back to front, and plots by the places that uPlot gives them.

const vectors = (() => {
  const text = (value) => `${value}`.replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
  const FINE = 1; // lines are joined from pieces to this length, pixels
  const digits = (value) => (Math.abs(value) < 1e7 ? +value.toFixed(2) : NaN); // far outside of the picture
  const place = ([x, y]) => `${digits(x)},${digits(y)}`;
  const svg = (width, height, paper, parts, title) =>
    `<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg" width="${digits(width)}" height="${digits(height)}" `
    + `viewBox="0 0 ${digits(width)} ${digits(height)}" font-family="system-ui, sans-serif" font-size="12">\n<title>${text(title)}</title>\n`
    + `<rect width="100%" height="100%" fill="${paper}"/>\n${parts.join("\n")}\n</svg>\n`;

  // ---- The picture ----

  // A scene as the view sees it; `sun` is the direction to the light, `light` its strength, `ambient` that of all around.
  function picture(scene, view, [width, height], paper, { sun, light, ambient }, title) {
    const [right, up, near] = view.axes();
    const [middle, scale] = [view.middle(), view.scale()];
    const { dot } = tools;
    const [alongRight, alongUp] = [dot(right, middle), dot(up, middle)];
    const seen = ({ x, y, z }) => {
      const point = [x, y, z];
      return { at: [width / 2 + (dot(right, point) - alongRight) * scale, height / 2 - (dot(up, point) - alongUp) * scale], depth: dot(near, point), point };
    };
    const corner = (attribute, i, matrix) => seen(new THREE.Vector3(attribute.getX(i), attribute.getY(i), attribute.getZ(i)).applyMatrix4(matrix));
    const found = []; // {order, depth, number, source}
    const add = (object, depth, source) => {
      if (source.includes("NaN")) return;
      // In space what may be hidden is drawn by its distance; what is painted first or last keeps its place.
      const order = tools.space && object.renderOrder >= 0 && object.material.depthTest !== false ? 0 : object.renderOrder;
      found.push({ order, depth: tools.space ? depth : 0, number: found.length, source });
    };
    const css = (color, strength = 1) => {
      const own = color.clone().multiplyScalar(strength);
      for (const part of ["r", "g", "b"]) own[part] = Math.min(own[part], 1);
      return own.getStyle();
    };
    const stroke = (ends, color, thickness) =>
      `<path d="M${place(ends[0].at)}L${place(ends[1].at)}" stroke="${color}" stroke-width="${digits(thickness)}" stroke-linecap="round"/>`;
    const apart = ([ax, ay], [bx, by]) => Math.hypot(ax - bx, ay - by);
    const drawn = (geometry, every) => Math.floor(Math.min(geometry.drawRange.count, geometry.index?.count ?? geometry.attributes.position.count) / every);

    function wide(line) { // of `lines`
      const { start, end } = line.geometry.attributes;
      const { width: thickness, color } = line.material.uniforms;
      const count = start ? drawn(line.geometry, 6) : 0;
      let from = null; // where pieces that are too short begin
      for (let i = 0; i < count; i += 1) {
        const ends = [start, end].map((attribute) => corner(attribute, 4 * i, line.matrixWorld));
        if (from && apart(from.at, ends[0].at) < 3 * FINE) ends[0] = from;
        from = null;
        if (i + 1 < count && apart(ends[0].at, ends[1].at) < FINE && apart(ends[1].at, corner(start, 4 * (i + 1), line.matrixWorld).at) < 0.01) {
          [from] = ends;
          continue;
        }
        add(line, (ends[0].depth + ends[1].depth) / 2, stroke(ends, css(color.value), thickness.value));
      }
    }
    function thin(object) {
      const { position, color } = object.geometry.attributes;
      for (let i = 0; position && i + 1 < position.count; i += 2) {
        const ends = [i, i + 1].map((k) => corner(position, k, object.matrixWorld));
        // Edges lie on their faces: they come after them.
        const own = object.material.vertexColors ? new THREE.Color(color.getX(i), color.getY(i), color.getZ(i)) : object.material.color;
        add(object, (ends[0].depth + ends[1].depth) / 2 + 2 / scale, stroke(ends, css(own), 1));
      }
    }
    function shade(corners, material) {
      if (!material.isMeshLambertMaterial) return 1;
      const [a, b, c] = corners.map(({ point }) => point);
      const [u, v] = [tools.subtract(b, a), tools.subtract(c, a)];
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const size = Math.hypot(...normal) * Math.hypot(...sun);
      return (ambient + (size > 0 ? light * Math.max(0, dot(normal, sun) / size) : 0)) / Math.PI;
    }
    function faces(object, matrix) {
      const { geometry, material } = object;
      const { position } = geometry.attributes;
      const flat = []; // the faces of an outline in the plane are one path
      for (let i = 0; i < drawn(geometry, 3); i += 1) {
        const corners = [0, 1, 2].map((k) => corner(position, geometry.index ? geometry.index.getX(3 * i + k) : 3 * i + k, matrix));
        const [a, b, c] = corners.map(({ at }) => at);
        const turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if (material.side !== THREE.DoubleSide && turn >= 0) continue; // seen from behind; y points down here
        const path = `M${place(a)}L${place(b)}L${place(c)}Z`;
        if (!tools.space) flat.push(path);
        else {
          const color = css(material.color, shade(corners, material));
          add(object, corners.reduce((sum, { depth }) => sum + depth / 3, 0), `<path d="${path}" fill="${color}" stroke="${color}" stroke-width="0.4"/>`);
        }
      }
      if (flat.length) {
        const color = css(material.color);
        add(object, 0, `<path d="${flat.join("")}" fill="${color}" stroke="${color}" stroke-width="0.4"/>`);
      }
    }

    scene.updateMatrixWorld();
    scene.traverseVisible((object) => {
      if (object.isLineSegments) thin(object);
      else if (!object.isMesh) return;
      else if (object.material.uniforms?.width) wide(object);
      else if (!object.geometry.attributes.position || !object.material.color) return;
      else if (object.isInstancedMesh) {
        const own = new THREE.Matrix4();
        for (let i = 0; i < object.count; i += 1) {
          object.getMatrixAt(i, own);
          faces(object, own.clone().premultiply(object.matrixWorld));
        }
      } else faces(object, object.matrixWorld);
    });
    found.sort((a, b) => a.order - b.order || a.depth - b.depth || a.number - b.number);
    return svg(width, height, paper, found.map(({ source }) => source), title);
  }

  // ---- Plots ----

  // A plot of uPlot. `curves` are {label, color, dash, series}, with the number of the series that is drawn; `corners` are
  // texts above the axes.
  function plot(u, curves, { ink, faint, rule, paper, corners, title }) {
    const ratio = uPlot.pxRatio;
    const [left, top, across, down] = ["left", "top", "width", "height"].map((key) => u.bbox[key] / ratio);
    const head = 18 * curves.length + 6;
    const parts = [];
    const write = (x, y, value, anchor, color = faint) =>
      parts.push(`<text x="${digits(x)}" y="${digits(y)}" text-anchor="${anchor}" fill="${color}">${text(value)}</text>`);
    const line = (a, b, color, thickness = 1) =>
      parts.push(`<path d="M${place(a)}L${place(b)}" stroke="${color}" stroke-width="${thickness}" fill="none"/>`);
    curves.forEach(({ label, color, dash }, k) => {
      const y = 4 + 18 * (k + 0.5) - head;
      parts.push(`<path d="M8,${y}L28,${y}" stroke="${color}" stroke-width="2" stroke-dasharray="${dash.join(" ") || "none"}"/>`);
      write(34, y + 4, label, "start", ink);
    });
    for (const { side, scale, grid, label, _splits: splits, _values: values } of u.axes) {
      (splits ?? []).forEach((value, i) => {
        if (side === 2) {
          const x = left + u.valToPos(value, scale);
          line([x, top], [x, top + down], rule);
          write(x, top + down + 16, values[i] ?? "", "middle");
        } else {
          const y = top + u.valToPos(value, scale);
          if (grid.show) line([left, y], [left + across, y], rule);
          write(side === 3 ? left - 6 : left + across + 6, y + 4, values[i] ?? "", side === 3 ? "end" : "start");
        }
      });
      if (label) write(left + across / 2, top + down + 34, label, "middle");
    }
    corners.forEach((corner, i) => write(i ? u.width - 4 : 4, 12, corner, i ? "end" : "start"));
    // What lies within the axes is a picture of its own, which ends at them.
    parts.push(`<svg x="${left}" y="${top}" width="${across}" height="${down}" viewBox="${left} ${top} ${across} ${down}">`);
    for (const { color, dash, series } of [...curves].sort((a, b) => a.series - b.series)) {
      const [xs, ys] = u.mode === 2 ? u.data[series] : [u.data[0], u.data[series]];
      const scale = u.mode === 2 ? "y0" : u.series[series].scale;
      let [path, open] = ["", false];
      for (let i = 0; i < xs.length; i += 1) {
        const at = [left + u.valToPos(xs[i], "x"), top + u.valToPos(ys[i] ?? NaN, scale)];
        const sound = ys[i] !== null && Number.isFinite(at[0] + at[1]) && Math.abs(at[0]) + Math.abs(at[1]) < 1e6;
        if (sound) path += `${open ? "L" : "M"}${place(at)}`;
        open = sound;
      }
      parts.push(`<path d="${path || "M0,0"}" fill="none" stroke="${color}" stroke-width="${u.series[series].width}" stroke-linejoin="round" stroke-dasharray="${dash.join(" ") || "none"}"/>`);
    }
    parts.push("</svg>");
    return svg(u.width, u.height + head, paper, [`<g transform="translate(0 ${head})">`, ...parts, "</g>"], title);
  }

  return { picture, plot };
})();

// `makeElements`: what effects look like: springs, dampers, ropes, motors, stops, contact spheres,
// wheels, fields, and what holds a joint in the world. Each mark of the drawing is a symbol in a frame;
// lines are made once and then placed for each picture.

const makeElements = (scene, mixed) => {
  const { space, number, vector, add, subtract, scaled, cross, unit, place, rotated } = tools;
  const { marks, symbols, balls } = DATA.drawing;
  const LAYERS = { fixed: -21, back: -20, middle: -20, front: 40 };
  const WIDTH = 1.8; // pixels of an ordinary line
  const [TAUT, WIDEST] = [1e-3, 0.3];
  const [GROUND, BEYOND] = [-60, 4]; // below what the grid is on, and to so many heights of the view
  const painted = []; // lines with the strength of their ink

  // Along, across it in the picture, and across both; none if the first has no length.
  function axes(along, radius, [right, , near]) {
    const across = cross(near, along);
    const aside = unit(Math.hypot(...across) > 1e-9 * Math.hypot(...along) ? across : right);
    return [along, scaled(aside, radius), scaled(unit(cross(along, aside)), radius)];
  }

  // What bends a rope that is longer than its way: a flat parabola, whose length is the span and 8/3 sag²/span.
  function sag(length, rest) {
    const slack = rest - length;
    if (slack <= TAUT * rest) return [0, 0, 0];
    const depth = 4 * Math.sqrt((3 / 8) * Math.max(length, 0.15 * rest) * slack);
    return space ? [0, 0, -depth] : [0, -depth, 0];
  }

  // The frames of a mark: the place of the origin, its axes, and what bends the first.
  const FRAMES = {
    between({ start, end, radius, rest }, { poses, values, view }) {
      const from = place(poses, start.body, vector(start.at, values));
      const along = subtract(place(poses, end.body, vector(end.at, values)), from);
      const length = Math.hypot(...along);
      const own = axes(along, Math.min(number(radius, values), WIDEST * length), view.axes());
      return [[from, own, rest === null ? null : sag(length, number(rest, values))]];
    },
    along({ at, body, axis, radius }, { poses, values, view }) {
      const size = number(radius, values);
      const along = scaled(unit(rotated(poses, body, vector(axis, values))), size);
      return [[place(poses, at.body, vector(at.at, values)), axes(along, size, view.axes())]];
    },
    turned({ at, body, x, y, radius }, { poses, values }) {
      const own = [x, y].map((axis) => scaled(rotated(poses, body, vector(axis, values)), number(radius, values)));
      return [[place(poses, at.body, vector(at.at, values)), [...own, [0, 0, 0]]]];
    },
    facing({ at, radius }, { poses, values, view }) {
      const own = view.axes().map((axis) => scaled(axis, number(radius, values)));
      return [[place(poses, at.body, vector(at.at, values)), own]];
    },
    arrows({ points, vectors: given, length }, { values, view }) {
      const found = given.map((each) => vector(each, values));
      const factor = number(length, values) / Math.max(...found.map((each) => Math.hypot(...each)));
      return found.map((each, k) => {
        const along = scaled(each, factor);
        return [add(vector(points[k], values), scaled(along, -0.5)), axes(along, Math.hypot(...along), view.axes())];
      });
    },
  };

  // The way of a rope or a belt: tangents between discs, and arcs on them; radii are positive where it goes round
  // counterclockwise.
  function way({ stops, radii, closed }, { poses, values }) {
    const places = stops.map((stop) => place(poses, stop.body, vector(stop.at, values)));
    const sizes = radii.map((radius) => number(radius, values));
    if (sizes.every((size) => size === 0)) return places.flat();
    if (closed) [places, sizes].forEach((list) => list.push(list[0]));
    const spans = places.slice(1).map((end, k) => {
      const [x, y] = subtract(end, places[k]);
      const h = sizes[k + 1] - sizes[k];
      const length = Math.sqrt(x * x + y * y - h * h);
      return Math.atan2(length * y - h * x, length * x + h * y);
    });
    return places.flatMap((at, k) => {
      const leaves = spans[k] ?? (closed ? spans[0] : spans[k - 1]);
      const came = spans[k - 1] ?? (closed ? spans[spans.length - 1] : leaves);
      const sign = Math.sign(sizes[k]);
      const turn = ((((leaves - came) * sign) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI);
      const count = sign && turn ? 24 : 0;
      return Array.from({ length: count + 1 }, (_, i) => {
        const angle = came + (count ? (sign * turn * i) / count : 0);
        return [at[0] + sizes[k] * Math.sin(angle), at[1] - sizes[k] * Math.cos(angle), at[2]];
      }).flat();
    });
  }

  const isOpen = ({ points, fill }) => fill > 0 && String(points[0]) !== String(points[points.length - 1]);

  // Points of a line of a symbol as pairs of ends, each moved by `spot`.
  const pieces = ({ points, dashed }, values, spot) =>
    (dashed ? lines.dashes : lines.pairs)(points.flatMap((point) => spot(vector(point, values))));

  // A line of a mark is set once, and then only its frame changes; but not what bends, or has many frames.
  const placed = marks.flatMap((mark) => symbols[mark.symbol].map((part) => {
    const line = lines.make({ color: "#888888", width: WIDTH * part.weight, pieces: true });
    line.renderOrder = LAYERS[mark.layer];
    painted.push([line, part.ink]);
    scene.add(line);
    if (mark.kind === "over") {
      return (now) => {
        const points = way(mark, now);
        line.visible = points.every(Number.isFinite);
        if (line.visible) line.setPoints(lines.pairs(points));
      };
    }
    const stiff = mark.kind !== "arrows" && !mark.rest && part.points.flat().every((x) => typeof x === "number");
    if (stiff) line.setPoints(pieces(part, [], (point) => point));
    return (now) => {
      const frames = FRAMES[mark.kind](mark, now);
      line.visible = frames.flat(3).every((x) => x === null || Number.isFinite(x));
      if (!line.visible) return;
      if (stiff) {
        const [[at, [x, y, z]]] = frames;
        line.matrix.set(x[0], y[0], z[0], at[0], x[1], y[1], z[1], at[1], x[2], y[2], z[2], at[2], 0, 0, 0, 1);
        line.matrixWorldNeedsUpdate = true;
        return;
      }
      line.setPoints(frames.flatMap(([at, [x, y, z], bend]) => pieces(part, now.values, ([a, b, c]) => {
        const spot = add(at, add(scaled(x, a), add(scaled(y, b), scaled(z, c))));
        return bend ? add(spot, scaled(bend, a * (1 - a))) : spot;
      })));
    };
  }));

  // The inside of balls and obstacles in the world.
  const solid = balls.filter(({ reach }) => reach === null || !space).map((ball) => {
    const mesh = new THREE.Mesh(space ? new THREE.SphereGeometry(1, 40, 24) : new THREE.CircleGeometry(1, 64),
      space ? new THREE.MeshLambertMaterial() : new THREE.MeshBasicMaterial());
    mesh.renderOrder = LAYERS.fixed - 1;
    painted.push([{ setColor: (color) => mesh.material.color.copy(color) }, 0.12]);
    scene.add(mesh);
    return ({ values }) => {
      mesh.position.set(...vector(ball.at, values));
      mesh.scale.setScalar(number(ball.radius, values));
    };
  });

  // What is below ground in the plane, however far the view shows it: below its line, which is open.
  const below = marks.flatMap((mark) => symbols[mark.symbol].filter(isOpen).map(({ points, fill }) => {
    const geometry = new THREE.BufferGeometry();
    const corners = new Float32Array(6 * points.length);
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    geometry.setIndex(points.slice(1).flatMap((_, i) => [0, 2, 1, 1, 2, 3].map((k) => 2 * i + k)));
    const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, depthWrite: false }));
    mesh.frustumCulled = false;
    mesh.renderOrder = GROUND;
    painted.push([{ setColor: (color) => mesh.material.color.copy(color) }, fill]);
    scene.add(mesh);
    return (now) => {
      const [[at, [x, y]]] = FRAMES[mark.kind](mark, now);
      const spots = points.map((point) => {
        const [along, up] = vector(point, now.values);
        return add(at, add(scaled(x, along), scaled(y, up)));
      });
      const deep = Math.min(now.view.middle()[1], ...spots.map(([, height]) => height)) - (BEYOND * now.view.height) / now.view.zoom;
      spots.forEach(([aside, height], i) => corners.set([aside, height, 0, aside, deep, 0], 6 * i));
      geometry.attributes.position.needsUpdate = true;
    };
  }));

  return {
    paint: () => painted.forEach(([line, ink]) => line.setColor(mixed(ink))),
    draw: (now) => [...placed, ...solid, ...below].forEach((update) => update(now)),
  };
};

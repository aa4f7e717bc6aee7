// `makeWorld`: what stands still around the mechanism: the grid or the floor, the planes of contacts,
// and wind. Colours are ink on the background, mixed and not transparent, so that what lies over
// another is not darker.

const makeWorld = (scene, mixed) => {
  const { space, number, vector, roundLength, add, scaled, dot, cross, unit } = tools;
  const LAYER = { planes: -60, grid: -50, surface: -40, wind: 60 }; // the order in which things are drawn
  const [GRID, HALF, PIECES] = [110, 14, 7]; // pixels between lines, at most; lines on each side; pieces of a line
  const { planes, floor } = DATA.drawing;
  const winds = DATA.drawing.winds.filter(({ velocity }) => velocity);

  // ---- Grid: lines through the view in the plane, a square that fades on the floor in space ----

  const grid = new THREE.LineSegments(new THREE.BufferGeometry(),
    new THREE.LineBasicMaterial({ vertexColors: true, depthWrite: false }));
  grid.frustumCulled = false;
  grid.renderOrder = LAYER.grid;
  scene.add(grid);
  let drawn = "";

  function gridLines(first, second, step, level) {
    const [positions, colors] = [[], []];
    const push = (point, strength) => {
      positions.push(...point);
      colors.push(...mixed(strength).toArray());
    };
    const point = (axis, across, along) => (axis === 0 ? [across, along, level] : [along, across, level]);
    for (const [axis, [middle, other, half, long]] of [first, second].entries()) {
      for (let i = -half; i <= half; i += 1) {
        const across = (middle + i) * step;
        const strength = middle + i === 0 ? 0.3 : 0.09;
        const fade = (along) => (space ? Math.max(0, 1 - Math.hypot(i, along) / HALF) : 1);
        const pieces = space ? PIECES * 2 : 1;
        for (let k = 0; k < pieces; k += 1) {
          for (const end of [k, k + 1]) {
            const along = -long + (2 * long * end) / pieces;
            push(point(axis, across, (other + along) * step), strength * fade(along));
          }
        }
      }
    }
    grid.geometry.dispose();
    grid.geometry = new THREE.BufferGeometry();
    grid.geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    grid.geometry.setAttribute("color", new THREE.Float32BufferAttribute(colors, 3));
  }

  function drawGrid(view, size, theme) {
    const scale = view.scale();
    const middle = view.middle();
    const step = space ? roundLength((1.3 * GRID) / scale) : roundLength(GRID / scale);
    const [x, y] = [Math.round(middle[0] / step), Math.round(middle[1] / step)];
    const [right, up] = space ? [HALF, HALF] : [size[0], size[1]].map((px) => Math.ceil(px / scale / step / 2) + 1);
    const state = [step, x, y, right, up, theme, floorLevel].join();
    if (state === drawn) return;
    drawn = state;
    gridLines([x, y, right, up], [y, x, up, right], step, space ? floorLevel : 0);
  }

  // ---- Planes ----

  let floorLevel = floor ? floor.z : 0;
  const fills = planes.map(() => new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, depthWrite: false }));
  const faces = planes.map((_, k) => {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(12), 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const face = new THREE.Mesh(geometry, fills[k]);
    face.frustumCulled = false;
    face.renderOrder = LAYER.planes;
    const rim = lines.make({ color: "#888888", width: 1.6 });
    rim.renderOrder = LAYER.surface;
    scene.add(face, rim);
    return { face, rim };
  });

  // The point of a plane below the middle of the view, its unit normal, and two directions along it.
  function frameOf(plane, values, poses, middle) {
    const given = unit(vector(plane.normal, values));
    const normal = plane.body < 0 ? given : tools.rotated(poses, plane.body, given);
    const origin = plane.body < 0 ? [0, 0, 0] : tools.center(poses, plane.body);
    const gap = dot(normal, middle) - dot(normal, origin) - number(plane.offset, values);
    const level = space && Math.hypot(normal[0], normal[1]) > 1e-9 ? unit(cross([0, 0, 1], normal)) : [1, 0, 0];
    const along = space ? [level, cross(normal, level)] : [[normal[1], -normal[0], 0], scaled(normal, -1)];
    return { foot: add(middle, scaled(normal, -gap)), along, level: space && normal[2] > 0.9999 };
  }

  function drawPlanes(view, size, poses, values) {
    const far = Math.hypot(...size) / view.scale();
    planes.forEach((plane, k) => {
      const { foot, along: [one, other], level } = frameOf(plane, values, poses, view.middle());
      // In space a level plane is the floor; others are squares. In the plane it is all that is behind.
      const half = space ? 0.35 * view.height / Math.min(view.zoom, 1) : far;
      const depth = space ? half : far + Math.hypot(...tools.subtract(foot, view.middle()));
      const corner = (a, b) => add(foot, add(scaled(one, a * half), scaled(other, b * depth)));
      const corners = [corner(-1, space ? -1 : 0), corner(1, space ? -1 : 0), corner(1, 1), corner(-1, 1)];
      const { face, rim } = faces[k];
      face.visible = !level;
      face.geometry.attributes.position.array.set(corners.flat());
      face.geometry.attributes.position.needsUpdate = true;
      rim.visible = !level;
      rim.setPoints((space ? [...corners, corners[0]] : corners.slice(0, 2)).flat());
      if (level && plane.body < 0) floorLevel = foot[2];
    });
  }

  // ---- Wind: streaks that move with it ----

  const STREAKS = 5; // in each direction
  const streaks = winds.map(() => {
    const streak = lines.make({ color: "#888888", width: 1.2, pieces: true });
    streak.renderOrder = LAYER.wind;
    scene.add(streak);
    return streak;
  });

  function drawWind(view, values, t) {
    winds.forEach((wind, k) => {
      const velocity = vector(wind.velocity, values);
      const [right, up, near] = view.axes();
      const span = (1.4 * view.height) / view.zoom / STREAKS;
      const speed = Math.hypot(...velocity);
      const tail = scaled(unit(velocity), -0.3 * span * Math.min(1, speed));
      const points = [];
      // Streaks lie on a grid that moves with the wind and that the view repeats.
      for (let i = 0; speed > 0 && i < STREAKS; i += 1) {
        for (let j = 0; j < STREAKS; j += 1) {
          const middle = view.middle();
          const offset = (axis, n) => {
            const moved = n * span + dot(axis, velocity) * t - dot(axis, middle) + (axis === right ? 0.37 * j : 0.61 * i) * span;
            const whole = STREAKS * span;
            return moved - whole * Math.floor(moved / whole) - whole / 2;
          };
          const head = add(middle, add(scaled(right, offset(right, i)), add(scaled(up, offset(up, j)), scaled(near, -0.2 * span))));
          points.push(...head, ...add(head, tail));
        }
      }
      streaks[k].visible = points.length > 0;
      if (points.length) streaks[k].setPoints(points);
    });
  }

  return {
    floorLevel: () => floorLevel,
    paint() {
      drawn = "";
      fills.forEach((fill) => fill.color.copy(mixed(0.08)));
      faces.forEach(({ rim }) => rim.setColor(mixed(0.45)));
      streaks.forEach((streak) => streak.setColor(mixed(0.35)));
    },
    draw(view, size, poses, values, t, theme) {
      drawPlanes(view, size, poses, values);
      drawGrid(view, size, theme);
      drawWind(view, values, t);
    },
  };
};

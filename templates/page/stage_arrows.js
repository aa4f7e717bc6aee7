// `makeArrows`: forces, torques, velocities and reactions of joints as arrows of one scale each, and
// the legend of the scales. The length of an arrow is in pixels, so that it does not change with the
// zoom; the scale is chosen so that a large value of the motion is of a good length.

const makeArrows = (scene, mechanism) => {
  const { space, center, place, vector, add, scaled, unit, cross } = tools;
  const KINDS = {
    forces: { unit: "N", color: "#d1495b", name: "force" },
    torques: { unit: "N m", color: "#b5179e", name: "torque" },
    velocities: { unit: "m/s", color: "#2a9d5c", name: "velocity" },
    reactions: { unit: "N", color: "#e08a00", name: "joint force" },
  };
  const BY_EFFECTS = new Set(["forces", "torques"]);
  const LIT = "#1f7ae0";
  const [BAR, USUAL, LONGEST] = [60, 100, 500]; // pixels: of the legend, of a large value, at most
  const [HEAD, NECK] = [11, 4.5]; // length and radius of an arrowhead, pixels
  const SMALLEST = 3; // shorter arrows are not drawn, pixels
  const ARC = 14; // pieces of the arc of a torque
  const LAYER = 80;
  const { joints } = DATA.drawing;
  const values = Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, 0])); // a large value

  // ---- What there is to draw: [point, vector] each, three components ----

  const three = (a, k) => (space ? [a[k], a[k + 1], a[k + 2]] : [a[k], a[k + 1], 0]);
  const FOUND = {
    forces({ given }) {
      if (!DATA.loads.length || !mechanism.loads) return [];
      const all = mechanism.loads(...given);
      const n = space ? 9 : 5;
      return DATA.loads.map((_, i) => [three(all, n * i), three(all, n * i + (space ? 3 : 2))]);
    },
    torques({ given }) {
      if (!DATA.loads.length || !mechanism.loads) return [];
      const all = mechanism.loads(...given);
      const n = space ? 9 : 5;
      return DATA.loads.map((_, i) => [three(all, n * i), space ? three(all, n * i + 6) : [0, 0, all[n * i + 4]]]);
    },
    velocities({ given, poses }) {
      if (!mechanism.bodyVelocities) return [];
      const all = mechanism.bodyVelocities(...given);
      return DATA.bodies.map((_, i) => [center(poses, i), three(all, (space ? 6 : 3) * i)]);
    },
    reactions({ given, poses, geometry }) {
      if (!mechanism.jointForces) return [];
      const all = mechanism.jointForces(...given);
      return joints.flatMap((joint, i) => (joint.type === "free" ? []
        : [[place(poses, joint.parent, vector(joint.at_parent, geometry)), three(all, (space ? 6 : 3) * i)]]));
    },
  };

  // The large value of each kind among some states: the largest but for a tenth of them.
  function calibrate(samples) {
    for (const kind of Object.keys(KINDS)) {
      const found = samples.map((now) => Math.max(0, ...FOUND[kind](now).map(([, v]) => Math.hypot(...v)))).filter(Number.isFinite);
      found.sort((a, b) => a - b);
      values[kind] = found.length ? found[Math.floor(0.9 * (found.length - 1))] : 0;
    }
  }

  // The value that the bar of the legend stands for.
  const barOf = (kind) => (values[kind] > 0 ? tools.roundLength((values[kind] * BAR * 1.2) / USUAL) : 1);

  // ---- Drawing ----

  const cone = new THREE.ConeGeometry(1, 1, 20).translate(0, -0.5, 0); // its tip is the origin
  const sets = [...Object.entries(KINDS).map(([kind, { color }]) => [kind, color, 2.6]), ["lit", LIT, 4]];
  const drawn = Object.fromEntries(sets.map(([kind, color, width]) => {
    const shaft = lines.make({ color, width, pieces: true });
    const most = Math.max(1, 2 * DATA.loads.length, DATA.bodies.length, joints.length);
    const heads = new THREE.InstancedMesh(cone, new THREE.MeshBasicMaterial({ color, depthTest: false }), most);
    shaft.material.depthTest = false;
    for (const object of [shaft, heads]) {
      object.frustumCulled = false;
      object.renderOrder = LAYER;
      object.visible = false;
      object.raycast = () => {};
      scene.add(object);
    }
    return [kind, { shaft, heads }];
  }));
  const spare = new THREE.Object3D();
  let reach = []; // {effect, points} of the arrows of effects that are drawn

  // An arrow from a point; the points of its shaft, and its tip and direction.
  function straight(from, along, length, pixel) {
    const tip = add(from, scaled(along, length * pixel));
    return [[...from, ...add(tip, scaled(along, -Math.min(HEAD, length) * 0.8 * pixel))], tip, along];
  }

  // Three quarters of a circle about the torque.
  function bent(from, axis, length, pixel) {
    const aside = Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const one = unit(cross(aside, axis));
    const two = cross(axis, one);
    const radius = (8 + length / 4) * pixel;
    const spot = (angle) => add(from, add(scaled(one, radius * Math.cos(angle)), scaled(two, radius * Math.sin(angle))));
    const points = [];
    for (let i = 0; i < ARC; i += 1) points.push(...spot((1.5 * Math.PI * i) / ARC), ...spot((1.5 * Math.PI * (i + 1)) / ARC));
    const ahead = unit(tools.subtract(spot(1.5 * Math.PI + 0.01), spot(1.5 * Math.PI - 0.01)));
    return [points, add(spot(1.5 * Math.PI), scaled(ahead, HEAD * 0.8 * pixel)), ahead];
  }

  // The arrows of a kind, {kind, from, v, size, effect}; the longest may change the scale.
  function arrowsOf(kind, now) {
    const all = FOUND[kind](now).map(([from, v], i) => ({ kind, from, v, size: Math.hypot(...v), effect: BY_EFFECTS.has(kind) ? DATA.loads[i].effect : null }))
      .filter(({ size }) => Number.isFinite(size));
    const largest = Math.max(0, ...all.map(({ size }) => size));
    if (largest > 1.5 * values[kind]) values[kind] = values[kind] > 0 ? Math.min(largest, 1.05 * values[kind]) : largest;
    return all;
  }

  function drawSet({ shaft, heads }, arrows, { pixel }) {
    const points = [];
    let count = 0;
    for (const { kind, from, v, size, effect } of arrows) {
      const length = Math.min((size * BAR) / barOf(kind), LONGEST);
      if (length < SMALLEST) continue;
      const [shafts, tip, along] = (kind === "torques" ? bent : straight)(from, unit(v), length, pixel);
      points.push(...shafts);
      if (effect) reach.push({ effect, points: [...shafts, ...shafts.slice(-3), ...tip] });
      const shrink = Math.min(1, length / HEAD) * pixel;
      shapes.turnTo(spare, along);
      spare.position.set(...tip);
      spare.scale.set(NECK * shrink, HEAD * shrink, NECK * shrink);
      spare.updateMatrix();
      heads.setMatrixAt(count, spare.matrix);
      count += 1;
    }
    shaft.visible = heads.visible = count > 0;
    if (!count) return;
    shaft.setPoints(points);
    heads.count = count;
    heads.instanceMatrix.needsUpdate = true;
  }

  // Distance on the screen from a spot to a piece of an arrow.
  function distance(spot, a, b) {
    const [along, to] = [b.map((x, k) => x - a[k]), spot.map((x, k) => x - a[k])];
    const square = along[0] ** 2 + along[1] ** 2;
    const part = square > 0 ? Math.min(Math.max((to[0] * along[0] + to[1] * along[1]) / square, 0), 1) : 0;
    return Math.hypot(to[0] - part * along[0], to[1] - part * along[1]);
  }

  // The effect of the arrow at a spot of the picture; null if there is none within so many pixels.
  function effectAt(spot, near, toScreen) {
    let [least, found] = [near, null];
    for (const { effect, points } of reach) {
      for (let i = 0; i < points.length; i += 6) {
        const far = distance(spot, toScreen(points.slice(i, i + 3)), toScreen(points.slice(i + 3, i + 6)));
        if (far < least) [least, found] = [far, effect];
      }
    }
    return found;
  }

  return {
    calibrate,
    // What the legend says: name, unit, colour, the value of a bar, and the bar's length in pixels.
    legend: (show) => Object.entries(KINDS).filter(([kind]) => (show[kind] || (show.lit && BY_EFFECTS.has(kind))) && values[kind] > 0)
      .map(([kind, about]) => ({ kind, ...about, value: barOf(kind), pixels: BAR })),
    // `show.lit` is the effect whose arrows are drawn in any case, in a colour of their own.
    draw(now, show) {
      const lit = [];
      reach = [];
      for (const kind of Object.keys(KINDS)) {
        const wanted = show[kind] || (show.lit && BY_EFFECTS.has(kind));
        const all = wanted ? arrowsOf(kind, now) : [];
        lit.push(...all.filter(({ effect }) => effect && effect === show.lit));
        drawSet(drawn[kind], show[kind] ? all.filter(({ effect }) => !effect || effect !== show.lit) : [], now);
      }
      drawSet(drawn.lit, lit, now);
    },
    effectAt,
  };
};

// `makeElements`: what effects look like: springs, dampers, ropes, motors, stops, contact spheres,
// wheels, obstacles, fields, and what holds a joint in the world. An element is made once and then
// placed for each picture; kinds that are not known are left out.

const makeElements = (scene, mixed) => {
  const { space, number, vector, add, subtract, scaled, cross, unit, place, rotated, center } = tools;
  const { elements, joints, size } = DATA.drawing;
  const LAYER = { behind: -20, front: 40 };
  const INK = 0.75;
  const SAG = 16; // pieces of a slack rope
  const ARROW = 26; // pixels of a field's longest arrow
  const painted = []; // lines with the strength of their ink

  function stroke(points, { ink = INK, width = 2, pieces = false, front = true } = {}) {
    const line = lines.make({ color: "#888888", width, pieces });
    line.renderOrder = front ? LAYER.front : LAYER.behind;
    if (points) line.setPoints(points);
    painted.push([line, ink]);
    scene.add(line);
    return line;
  }

  // Two directions across a given one; in the plane the first lies in the plane.
  function across(axis) {
    if (!space) return [[-axis[1], axis[0], 0], [0, 0, 1]];
    const aside = Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const first = unit(cross(aside, axis));
    return [first, cross(axis, first)];
  }

  // Place an object so that its x axis is `one`, and so on.
  function frame(object, at, one, two, three) {
    object.matrix.set(one[0], two[0], three[0], at[0], one[1], two[1], three[1], at[1], one[2], two[2], three[2], at[2], 0, 0, 0, 1);
    object.matrixWorldNeedsUpdate = true;
  }

  // ---- Between two points: drawn from x = 0 to 1, stretched to its length ----

  function coilPoints(turns = 9, side = 0, width = 1) {
    const points = [0, side, 0, 0.12, side, 0];
    const count = space ? turns * 20 : turns * 2;
    for (let i = 1; i < count; i += 1) {
      const angle = (2 * Math.PI * turns * i) / count;
      const x = 0.12 + (0.76 * i) / count;
      if (space) points.push(x, side + width * Math.cos(angle), width * Math.sin(angle));
      else points.push(x, side + width * (i % 2 ? 1 : -1), 0);
    }
    points.push(0.88, side, 0, 1, side, 0);
    return points;
  }

  // A cylinder, open to the right, and its piston.
  const damperPoints = (side = 0, w = 0.8) => [
    [0, side, 0.35, side], [0.35, side - w, 0.35, side + w], [0.35, side - w, 0.68, side - w],
    [0.35, side + w, 0.68, side + w], [0.55, side - 0.7 * w, 0.55, side + 0.7 * w], [0.55, side, 1, side],
  ].flatMap(([x, y, x2, y2]) => [x, y, 0, x2, y2, 0]);

  const LINKS = {
    coil: () => [stroke(coilPoints())],
    damper: () => [stroke(damperPoints(), { pieces: true })],
    spring_damper: () => [
      stroke(coilPoints(9, 0.9, 0.6)),
      stroke([...damperPoints(-0.9, 0.55), 0, -0.9, 0, 0, 0.9, 0, 1, -0.9, 0, 1, 0.9, 0], { pieces: true }),
    ],
  };

  function link(element) {
    const parts = LINKS[element.kind]();
    return ({ poses, values }) => {
      const from = place(poses, element.from.body, vector(element.from.at, values));
      const along = subtract(place(poses, element.to.body, vector(element.to.at, values)), from);
      const [one, two] = across(unit(along));
      const radius = number(element.radius, values);
      for (const part of parts) frame(part, from, along, scaled(one, radius), scaled(two, radius));
    };
  }

  // A rope is straight when taut and hangs in a parabola of its length when slack.
  function rope(element) {
    const line = stroke(null, { width: 2 });
    return ({ poses, values }) => {
      const from = place(poses, element.from.body, vector(element.from.at, values));
      const along = subtract(place(poses, element.to.body, vector(element.to.at, values)), from);
      const length = Math.hypot(...along);
      const rest = element.rest === null ? 0 : number(element.rest, values);
      const sag = rest > length ? Math.sqrt((3 / 8) * length * (rest - length)) + (rest - length) * 0.2 : 0;
      const points = [];
      for (let i = 0; i <= SAG; i += 1) {
        const part = i / SAG;
        const point = add(from, scaled(along, part));
        point[space ? 2 : 1] -= 4 * sag * part * (1 - part);
        points.push(...point);
      }
      line.setPoints(points);
      line.setColor(mixed(sag > 0 ? 0.4 : 0.85));
    };
  }

  // ---- At joints ----

  // Where a joint is, its axis, and the direction of its child's centre of mass in the parent's axes
  // while the coordinate is 0.
  function jointFrame(index, { poses, values }) {
    const joint = joints[index];
    const at = place(poses, joint.parent, vector(joint.at_parent, values));
    const axis = joint.axis && space ? vector(joint.axis, values) : [0, 0, 1];
    let toward = scaled(vector(joint.at_child, values), -1);
    toward = subtract(toward, scaled(axis, tools.dot(axis, toward)));
    toward = Math.hypot(...toward) > 1e-9 * size ? unit(toward) : across(axis)[0];
    const world = (r) => rotated(poses, joint.parent, r);
    return {
      at,
      axis: world(axis),
      one: world(toward),
      two: world(cross(axis, toward)),
      slides: joint.type === "prismatic",
      line: world(joint.axis ? vector(joint.axis, values) : toward),
    };
  }

  // Whether an element's coordinate is a displacement along the joint's axis; then it is drawn in a
  // frame at the child's point whose x axis is the joint's.
  const slides = ({ joint, coordinate }) => Boolean(joints[joint].axis)
    && (joints[joint].type === "prismatic" || (joints[joint].type === "cylindrical" && !coordinate));
  function placedAtSlider(element, parts) {
    const { child, at_child: point } = joints[element.joint];
    return (now) => {
      const along = unit(jointFrame(element.joint, now).line);
      const [one, two] = across(along);
      const radius = number(element.radius, now.values);
      const at = place(now.poses, child, vector(point, now.values));
      for (const part of parts) frame(part, at, scaled(along, radius), scaled(one, radius), scaled(two, radius));
    };
  }

  function placedAtJoint(element, parts, factor = 1) {
    return (now) => {
      const { at, axis, one, two } = jointFrame(element.joint, now);
      const radius = factor * number(element.radius, now.values);
      for (const part of parts) frame(part, at, scaled(one, radius), scaled(two, radius), scaled(axis, radius));
    };
  }

  function spiral(turns) {
    const points = [];
    for (let i = 0; i <= 72; i += 1) {
      const radius = 0.2 + (0.8 * i) / 72;
      const angle = (turns * 2 * Math.PI * i) / 72;
      points.push(radius * Math.cos(angle), radius * Math.sin(angle), 0);
    }
    return points;
  }

  const ring = (from, to, ink = INK) => stroke(lines.arc(from, to), { ink, width: 2.2 });
  function motor(element) {
    if (slides(element)) {
      const arrow = [-1.2, 1, 0, 1.2, 1, 0, 0.8, 1.3, 0, 1.2, 1, 0, 1.2, 1, 0, 0.8, 0.7, 0];
      return placedAtSlider(element, [stroke(arrow, { pieces: true, width: 2.2 })]);
    }
    // An arc with an arrowhead.
    const end = 1.6 * Math.PI;
    const [x, y] = [Math.cos(end), Math.sin(end)];
    const head = [[-0.28, -0.1], [0.02, 0.3]].flatMap(([out, back]) =>
      [x, y, 0, x + out * x + back * y, y + out * y - back * x, 0]);
    const parts = [ring(0.1 * Math.PI, end), stroke(head, { pieces: true, width: 2.2 })];
    if (element.kind !== "motor") parts.push(ring(0, 2 * Math.PI, 0.35));
    return placedAtJoint(element, parts, 1.15);
  }

  // The range of a joint: an arc between its limits, or bars across the line of a slider.
  function stop(element) {
    const line = stroke(null, { pieces: true, ink: 0.5, width: 1.8 });
    return (now) => {
      const { values } = now;
      const found = jointFrame(element.joint, now);
      const limits = [element.low, element.high].map((x) => (x === null || x === undefined ? null : number(x, values)));
      const radius = 1.5 * number(element.radius, values);
      const points = [];
      if (found.slides) {
        const [side] = across(found.line);
        for (const limit of limits) {
          if (limit === null) continue;
          const at = add(found.at, scaled(found.line, limit));
          points.push(...add(at, scaled(side, radius)), ...add(at, scaled(side, -radius)));
        }
      } else {
        const spot = (angle, r) => add(found.at, add(scaled(found.one, r * Math.cos(angle)), scaled(found.two, r * Math.sin(angle))));
        const [low, high] = [limits[0] ?? limits[1], limits[1] ?? limits[0]];
        for (const limit of limits) if (limit !== null) points.push(...spot(limit, 0.7 * radius), ...spot(limit, 1.25 * radius));
        const span = Math.min(high - low, 2 * Math.PI);
        for (let i = 0; span > 0 && i < 24; i += 1) {
          points.push(...spot(low + (span * i) / 24, radius), ...spot(low + (span * (i + 1)) / 24, radius));
        }
      }
      line.visible = points.length > 0;
      if (points.length) line.setPoints(points);
    };
  }

  // ---- Balls, wheels, obstacles ----

  function ball(element) {
    const fixed = element.body < 0;
    const circle = stroke(lines.arc(0, 2 * Math.PI, 64), { ink: fixed ? 0.45 : 0.4, width: 1.4, front: !fixed });
    const parts = [[circle, 1]];
    if (element.kind === "wheel") {
      const spokes = [0, 1, 2].flatMap((k) => [0, 0, 0, Math.cos((2 * k * Math.PI) / 3), Math.sin((2 * k * Math.PI) / 3), 0]);
      parts.push([stroke(spokes, { pieces: true, ink: 0.45, width: 1.4 }), 1]);
    }
    let body = null;
    if (fixed) {
      body = new THREE.Mesh(space ? new THREE.SphereGeometry(1, 40, 24) : new THREE.CircleGeometry(1, 64),
        space ? new THREE.MeshLambertMaterial() : new THREE.MeshBasicMaterial());
      body.matrixAutoUpdate = false;
      body.renderOrder = LAYER.behind - 1;
      painted.push([{ setColor: (color) => body.material.color.copy(color) }, 0.12]);
      if (element.reach === null || element.reach === undefined || !space) scene.add(body);
    }
    const reach = element.reach === null || element.reach === undefined ? null
      : stroke(lines.dashes(lines.arc(0, 2 * Math.PI, 90)), { pieces: true, ink: 0.4, width: 1.4, front: false });
    return ({ poses, values, view, pixel }) => {
      const at = place(poses, element.body, vector(element.at, values));
      const radius = Math.max(number(element.radius, values), 3 * pixel);
      let [one, two, three] = view.axes(); // a sphere's outline faces the eye
      if (element.kind === "wheel") {
        const axis = space ? unit(vector(element.axis ?? [0, 0, 1], values)) : [0, 0, 1];
        const spoke = space ? across(axis)[0] : [1, 0, 0];
        three = space ? rotated(poses, element.body, axis) : axis;
        one = rotated(poses, element.body, spoke);
        two = cross(three, one);
      }
      const put = (object, r) => frame(object, at, scaled(one, r), scaled(two, r), scaled(three, r));
      for (const [part, factor] of parts) put(part, radius * factor);
      if (body) put(body, radius);
      if (reach) put(reach, radius + number(element.reach, values));
    };
  }

  // ---- Fields: arrows on a coarse grid about the centre, or those given ----

  const FORMS = { attract: (x, y) => [-x, -y], repel: (x, y) => [x, y], vortex: (x, y) => [-y, x] };
  function arrowPieces(from, to) {
    const along = subtract(to, from);
    const [side] = across(unit(along));
    const back = add(to, scaled(along, -0.35));
    const wing = 0.18 * Math.hypot(...along);
    return [...from, ...to, ...to, ...add(back, scaled(side, wing)), ...to, ...add(back, scaled(side, -wing))];
  }
  function field(element) {
    const line = stroke(null, { pieces: true, ink: 0.3, width: 1.4, front: false });
    return ({ values, pixel }) => {
      const points = [];
      const longest = ARROW * pixel;
      const steps = [-2, -1, 0, 1, 2].map((k) => k * Math.max(0.6 * size, 1.6 * longest));
      if (element.points?.length) {
        const ends = element.points.map((point) => vector(point, values));
        const forces = element.forces.map((force) => vector(force, values));
        const largest = Math.max(...forces.map((force) => Math.hypot(...force))) || 1;
        ends.forEach((from, k) => points.push(...arrowPieces(from, add(from, scaled(forces[k], longest / largest)))));
      } else if (element.center && FORMS[element.form]) {
        const middle = vector(element.center, values);
        for (const x of steps) {
          for (const y of steps) {
            const r = Math.hypot(x, y);
            if (!r) continue;
            const [dx, dy] = FORMS[element.form](x / r, y / r).map((part) => 0.5 * longest * part);
            points.push(...arrowPieces(add(middle, [x - dx, y - dy, 0]), add(middle, [x + dx, y + dy, 0])));
          }
        }
      }
      line.visible = points.length > 0;
      if (points.length) line.setPoints(points);
    };
  }

  // ---- What holds the mechanism ----

  const toGround = (element, values) => (element.axis ? vector(element.axis, values) : [0, space ? 0 : -1, space ? -1 : 0]);
  function base(element) {
    if (space) {
      const post = new THREE.Mesh(new THREE.CylinderGeometry(1, 1.3, 0.8, 32), new THREE.MeshLambertMaterial());
      painted.push([{ setColor: (color) => post.material.color.copy(color) }, 0.4]);
      scene.add(post);
      return ({ values }) => {
        const radius = number(element.radius, values);
        const ground = toGround(element, values);
        post.scale.setScalar(radius);
        shapes.turnTo(post, scaled(ground, -1));
        post.position.set(...add(vector(element.at, values), scaled(ground, 0.4 * radius)));
      };
    }
    const hatch = [-1, -0.5, 0, 0.5, 1].flatMap((x) => [x + 0.15, -1.2, 0, x - 0.2, -1.6, 0]);
    const line = stroke([0, 0, 0, -0.8, -1.2, 0, 0, 0, 0, 0.8, -1.2, 0, -1.3, -1.2, 0, 1.3, -1.2, 0, ...hatch],
      { pieces: true, ink: 0.6, width: 1.6, front: false });
    return ({ values }) => {
      const radius = number(element.radius, values);
      const up = scaled(toGround(element, values), -radius);
      frame(line, vector(element.at, values), [up[1], -up[0], 0], up, [0, 0, radius]);
    };
  }

  function rail(element) {
    const line = stroke(null, { ink: 0.5, width: 3, front: false });
    return ({ poses, values }) => {
      const at = vector(element.at, values);
      const axis = vector(element.axis, values);
      const ends = [element.low, element.high].map((x) => place(poses, element.body, add(at, scaled(axis, number(x, values)))));
      line.setPoints(ends.flat());
    };
  }

  function attraction(element) {
    const parts = [1, 0.45].map((r) => stroke(lines.arc(0, 2 * Math.PI, 32, r), { ink: 0.6, width: 1.8, front: false }));
    return ({ values, view }) => {
      const [one, two, three] = view.axes().map((axis) => scaled(axis, 0.08 * size));
      for (const part of parts) frame(part, vector(element.center ?? element.from?.at ?? [0, 0, 0], values), one, two, three);
    };
  }

  const MAKERS = {
    coil: link, damper: link, spring_damper: link, rope, motor, servo: motor, drive: motor, stop,
    torsion: (element) => (slides(element)
      ? placedAtSlider(element, [stroke(coilPoints(5, 0, 0.4).map((x, i) => (i % 3 ? x : 2.4 * x - 1.2)))])
      : placedAtJoint(element, [stroke(spiral(2.75), { width: 1.8 })], 1)),
    ball, wheel: ball, obstacle: ball, field, base, rail, attraction,
  };

  const placers = elements.filter((element) => MAKERS[element.kind])
    .map((element) => [element, MAKERS[element.kind](element)]);
  return {
    paint: () => painted.forEach(([line, ink]) => line.setColor(mixed(ink))),
    draw: (now) => placers.forEach(([, update]) => update(now)),
  };
};

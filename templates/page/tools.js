// Small helpers that all parts of the page use: numbers of the drawing, points of bodies, elements.

const tools = (() => {
  const space = DATA.dimensions === 3;
  const REST = space ? [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0] : [0, 0, 0]; // the pose of the world

  // The pose of a body, or of the world (-1), and its first index.
  const poseOf = (poses, body) => (body < 0 ? [REST, 0] : [poses, body * REST.length]);

  // A vector of body axes in world axes.
  function rotated(poses, body, r) {
    const [p, k] = poseOf(poses, body);
    if (!space) {
      const [c, s] = [Math.cos(p[k + 2]), Math.sin(p[k + 2])];
      return [c * r[0] - s * r[1], s * r[0] + c * r[1], 0];
    }
    return [0, 4, 8].map((row) => p[k + row] * r[0] + p[k + row + 1] * r[1] + p[k + row + 2] * r[2]);
  }

  // The centre of mass of a body, three components; z is 0 in the plane.
  function center(poses, body) {
    const [p, k] = poseOf(poses, body);
    return space ? [p[k + 3], p[k + 7], p[k + 11]] : [p[k], p[k + 1], 0];
  }

  const add = (a, b) => [a[0] + b[0], a[1] + b[1], (a[2] ?? 0) + (b[2] ?? 0)];
  const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], (a[2] ?? 0) - (b[2] ?? 0)];
  const scaled = (a, factor) => [a[0] * factor, a[1] * factor, (a[2] ?? 0) * factor];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + (a[2] ?? 0) * (b[2] ?? 0);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => {
    const length = Math.hypot(...a);
    return length > 0 ? scaled(a, 1 / length) : [0, 0, 0];
  };

  // The point of the world at `at` of a body, given from its centre of mass in body axes.
  const place = (poses, body, at) => add(center(poses, body), rotated(poses, body, at));

  // A point of a body from a point of the world: the inverse of `place`.
  function pointOf(poses, body, world) {
    const [p, k] = poseOf(poses, body);
    const d = subtract(world, center(poses, body));
    if (!space) {
      const [c, s] = [Math.cos(p[k + 2]), Math.sin(p[k + 2])];
      return [c * d[0] + s * d[1], c * d[1] - s * d[0]];
    }
    return [0, 1, 2].map((column) => [0, 4, 8].reduce((sum, row, i) => sum + p[k + row + column] * d[i], 0));
  }

  // A number of the drawing is a number, or {of: k}, a value that the mechanism computes.
  const number = (x, values) => (typeof x === "number" ? x : values[x.of]);
  const vector = (list, values) => {
    const [x, y, z] = list;
    return [number(x, values), number(y, values), z === undefined ? 0 : number(z, values)];
  };

  // The largest of 1, 2, 5 times a power of ten that does not exceed `length`.
  function roundLength(length) {
    const power = 10 ** Math.floor(Math.log10(length));
    return power * [5, 2, 1].find((digit) => digit * power <= length * 1.0000001);
  }

  // An element with attributes and content; text is set as text.
  function element(tag, attributes = {}, ...content) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (value === true) made.setAttribute(name, "");
      else if (value !== false && value !== null) made.setAttribute(name, value);
    }
    made.append(...content);
    return made;
  }

  // Arrays are stored as base64 of little-endian numbers.
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;

  return {
    space, rotated, center, place, pointOf, add, subtract, scaled, dot, cross, unit, number, vector,
    roundLength, element, bytes, byId: (id) => document.getElementById(id),
  };
})();

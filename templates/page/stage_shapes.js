// `shapes`: the meshes of bodies, with their edges. In the plane they are flat outlines.

const shapes = (() => {
  const { number, vector } = tools;
  const ROUND = 48; // corners of a circle
  const SHARP = 30; // edges of less degrees are not drawn
  const fills = new Map(); // materials by colour

  function fill(color) {
    if (!fills.has(color)) {
      fills.set(color, tools.space ? new THREE.MeshLambertMaterial({ color })
        : new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide, depthTest: false }));
    }
    return fills.get(color);
  }
  const dark = new Map(); // edges by colour: the same colour, darker
  function edge(color) {
    if (!dark.has(color)) {
      const own = new THREE.Color(color).multiplyScalar(0.35);
      dark.set(color, new THREE.LineBasicMaterial({ color: own, depthTest: tools.space }));
    }
    return dark.get(color);
  }

  // ---- The plane ----

  // Corners of the outline of a planar shape, [x, y] each.
  function outline(shape, values) {
    const at = (point) => vector(point, values);
    if (shape.type === "polygon") return shape.points.map(at);
    if (shape.type === "rod") {
      const [start, end] = [at(shape.start), at(shape.end)];
      const along = Math.atan2(end[1] - start[1], end[0] - start[0]);
      return [...circle(end, number(shape.width, values) / 2, along - Math.PI / 2, along + Math.PI / 2, ROUND / 2),
        ...circle(start, number(shape.width, values) / 2, along + Math.PI / 2, along + 1.5 * Math.PI, ROUND / 2)];
    }
    const center = shape.center ? at(shape.center) : [0, 0, 0];
    if (shape.type === "disc") return circle(center, number(shape.radius, values), 0, 2 * Math.PI, ROUND).slice(1);
    const [width, height] = vector(shape.size, values);
    const [c, s] = [Math.cos(number(shape.angle ?? 0, values)), Math.sin(number(shape.angle ?? 0, values))];
    return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => {
      const [x, y] = [(i * width) / 2, (j * height) / 2];
      return [center[0] + c * x - s * y, center[1] + s * x + c * y];
    });
  }

  function circle(center, radius, from, to, count) {
    return Array.from({ length: count + 1 }, (_, i) => {
      const angle = from + ((to - from) * i) / count;
      return [center[0] + radius * Math.cos(angle), center[1] + radius * Math.sin(angle)];
    });
  }

  function flat(shape, values) {
    const corners = outline(shape, values);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners.flatMap(([x, y]) => [x, y, 0]), 3));
    const faces = THREE.ShapeUtils.triangulateShape(corners.map(([x, y]) => new THREE.Vector2(x, y)), []);
    geometry.setIndex(faces.flat());
    const rim = new THREE.BufferGeometry();
    const ends = corners.flatMap((corner, i) => [corner, corners[(i + 1) % corners.length]]);
    if (shape.type === "disc") { // a spoke makes the rotation of a disc visible
      const center = shape.center ? vector(shape.center, values) : [0, 0];
      ends.push(center, [center[0] + number(shape.radius, values), center[1]]);
    }
    rim.setAttribute("position", new THREE.Float32BufferAttribute(ends.flatMap(([x, y]) => [x, y, 0]), 3));
    return [new THREE.Mesh(geometry, fill(shape.color)), new THREE.LineSegments(rim, edge(shape.color))];
  }

  // ---- Space ----

  // The rotation from y, the axis of three.js's cylinders, to a direction.
  function turnTo(object, direction) {
    object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...direction).normalize());
  }

  function between(object, shape, values) {
    const [start, end] = [vector(shape.start, values), vector(shape.end, values)];
    object.position.set(...tools.scaled(tools.add(start, end), 0.5));
    const along = tools.subtract(end, start);
    if (Math.hypot(...along) > 0) turnTo(object, along);
    return object;
  }

  function solid(shape, values) {
    const length = () => Math.hypot(...tools.subtract(vector(shape.end, values), vector(shape.start, values)));
    if (shape.type === "rod") {
      const radius = number(shape.width, values) / 2;
      return between(new THREE.Mesh(new THREE.CapsuleGeometry(radius, length(), 8, 20), fill(shape.color)), shape, values);
    }
    if (shape.type === "cylinder") {
      const radius = number(shape.radius, values);
      return between(new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, length(), 40), fill(shape.color)), shape, values);
    }
    const geometry = shape.type === "box" ? new THREE.BoxGeometry(...vector(shape.size, values))
      : new THREE.SphereGeometry(1, 32, 20);
    const mesh = new THREE.Mesh(geometry, fill(shape.color));
    if (shape.type === "sphere") mesh.scale.setScalar(number(shape.radius, values));
    if (shape.type === "ellipsoid") mesh.scale.set(...vector(shape.radii, values));
    if (shape.center) mesh.position.set(...vector(shape.center, values));
    if (shape.orientation_deg) {
      // About the fixed x, then y, then z.
      mesh.rotation.set(...shape.orientation_deg.map((a) => (number(a, values) * Math.PI) / 180), "ZYX");
    }
    return mesh;
  }

  function withEdges(shape, mesh) {
    if (shape.type !== "box" && shape.type !== "cylinder") return [mesh];
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry, SHARP), edge(shape.color));
    edges.position.copy(mesh.position);
    edges.quaternion.copy(mesh.quaternion);
    return [mesh, edges];
  }

  // The objects of a shape: its mesh, then its edges if it has any.
  const objects = (shape, values) => (tools.space ? withEdges(shape, solid(shape, values)) : flat(shape, values));

  // The indices of the computed values that a body's shapes depend on.
  function needs(value, found = new Set()) {
    if (value && typeof value === "object") {
      if (typeof value.of === "number") found.add(value.of);
      else for (const part of Object.values(value)) needs(part, found);
    }
    return found;
  }

  return { objects, needs, turnTo };
})();

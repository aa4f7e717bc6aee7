// `makeMarks`: joints, by type, ends of springs and ropes, and centres of mass, of a constant size on
// the screen.

const makeMarks = (scene, paper, mixed) => {
  const { center, place, vector } = tools;
  const { joints, bodies, ends } = DATA.drawing;
  const MANY = 30; // more marks than these are smaller until the view comes closer
  const SIDES = { revolute: 24, spherical: 24, universal: 24, prismatic: 4, cylindrical: 4, fixed: 3 };
  const shown = [
    ...joints.filter(({ type }) => !["free", "planar", "particle"].includes(type)),
    ...ends.map(({ body, at }) => ({ type: "end", child: body, at_child: at })),
  ];
  const LAYER = 70;

  function instances(sides, count, layer) {
    const mesh = new THREE.InstancedMesh(new THREE.CircleGeometry(1, sides, Math.PI / 4),
      new THREE.MeshBasicMaterial({ depthTest: false, depthWrite: false }), Math.max(1, count));
    mesh.frustumCulled = false;
    mesh.renderOrder = layer;
    mesh.raycast = () => {};
    mesh.count = count;
    scene.add(mesh);
    return mesh;
  }

  // A mark is a disc of ink and a smaller one of the background's colour on it; a ball joint is full.
  const groups = [...new Set(shown.map(({ type }) => SIDES[type] ?? 24))].map((sides) => {
    const own = shown.filter(({ type }) => (SIDES[type] ?? 24) === sides);
    return { own, outer: instances(sides, own.length, LAYER), inner: instances(sides, own.length, LAYER + 1) };
  });
  const dots = instances(16, bodies.length, LAYER + 2);
  const matrix = new THREE.Matrix4();

  function put(mesh, k, at, radius, [right, up, near]) {
    matrix.set(right[0] * radius, up[0] * radius, near[0], at[0], right[1] * radius, up[1] * radius, near[1], at[1],
      right[2] * radius, up[2] * radius, near[2], at[2], 0, 0, 0, 1);
    mesh.setMatrixAt(k, matrix);
  }

  return {
    paint() {
      for (const { outer, inner } of groups) {
        outer.material.color.copy(mixed(0.85));
        inner.material.color.copy(paper());
      }
      dots.material.color.copy(mixed(0.6));
    },
    draw({ poses, geometry, pixel, view }, show) {
      const axes = view.axes();
      const size = 4.2 * Math.min(1, Math.max(0.45, (view.zoom * MANY) / shown.length));
      for (const { own, outer, inner } of groups) {
        outer.visible = inner.visible = show.joints;
        if (!show.joints) continue;
        own.forEach((joint, k) => {
          const at = place(poses, joint.child, vector(joint.at_child, geometry));
          put(outer, k, at, size * pixel, axes);
          put(inner, k, at, (joint.type === "spherical" ? 0.3 : 0.62) * size * pixel, axes);
        });
        outer.instanceMatrix.needsUpdate = inner.instanceMatrix.needsUpdate = true;
      }
      dots.visible = show.centres || bodies.some((body) => !body.shapes.length);
      bodies.forEach((body, k) => {
        const radius = body.shapes.length ? (show.centres ? 2.6 : 0) : 6;
        put(dots, k, center(poses, k), radius * pixel, axes);
      });
      dots.instanceMatrix.needsUpdate = true;
    },
  };
};

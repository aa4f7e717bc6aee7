// `makeBodies`: a group of objects for each body, which is built anew when a parameter changes its shapes.
// `objectsOf(shape, geometry, index, k, count)`: the objects of shape k of the `count` of a body.

const makeBodies = (scene, objectsOf) => {
  const bodies = DATA.drawing.bodies.map(({ shapes: own }, index) => {
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    scene.add(group);
    return { own, index, group, needs: [...shapes.needs(own)], built: null };
  });

  return {
    groups: bodies.map(({ group }) => group),
    // Build them anew, in other colours.
    paint: () => bodies.forEach((entry) => (entry.built = null)),
    // The bodies as they are looked at; none for null.
    draw(now) {
      for (const entry of bodies) {
        const { own, index, group, needs } = entry;
        group.visible = Boolean(now);
        if (!now) continue;
        const state = needs.map((k) => now.geometry[k]).join();
        if (entry.built !== state) {
          group.clear();
          own.forEach((shape, k) => group.add(...objectsOf(shape, now.geometry, index, k, own.length)));
          entry.built = state;
        }
        if (tools.space) group.matrix.set(...now.poses.slice(12 * index, 12 * index + 12), 0, 0, 0, 1);
        else {
          const [x, y, angle] = now.poses.slice(3 * index, 3 * index + 3);
          const [c, s] = [Math.cos(angle), Math.sin(angle)];
          group.matrix.set(c, -s, 0, x, s, c, 0, y, 0, 0, 1, 0, 0, 0, 0, 1);
        }
        group.matrixWorldNeedsUpdate = true;
      }
    },
  };
};

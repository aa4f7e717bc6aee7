// `makeGhosts`: the bodies of another run, faint, before those of the first.

const makeGhosts = (scene, paper) => {
  const [FAINT, LAYER] = [0.3, -8];
  const bodies = DATA.drawing.bodies.map((body, index) => {
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    scene.add(group);
    return { body, index, group, needs: [...shapes.needs(body.shapes)], built: null };
  });

  function build({ body, index, group }, geometry) {
    group.clear();
    body.shapes.forEach((shape) => {
      const [mesh] = shapes.objects(shape, geometry);
      mesh.material = mesh.material.clone();
      // In the plane what is drawn first is behind; what is transparent would be drawn last.
      if (tools.space) Object.assign(mesh.material, { transparent: true, opacity: FAINT, depthWrite: false });
      else mesh.material.color.lerp(paper(), 1 - FAINT);
      mesh.renderOrder = LAYER + index;
      group.add(mesh);
    });
  }

  return {
    paint: () => bodies.forEach((entry) => (entry.built = null)),
    // The bodies as they are looked at; none for null.
    draw(now) {
      for (const entry of bodies) {
        entry.group.visible = Boolean(now);
        if (!now) continue;
        const state = entry.needs.map((k) => now.geometry[k]).join();
        if (entry.built !== state) build(entry, now.geometry);
        entry.built = state;
        shapes.placeAt(entry.group, now.poses, entry.index);
      }
    },
  };
};

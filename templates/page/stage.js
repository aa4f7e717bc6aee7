// `makeStage`: the moving picture, of a mechanism in the plane or in space. It owns the canvas and
// draws a state; it knows nothing of time. Without WebGL it draws nothing and says so in `failed`;
// all else of it works.

const makeStage = (canvas, mechanism) => {
  const { space, vector, center } = tools;
  const { drawing } = DATA;
  const view = makeView(canvas);
  const DEEP = 60; // the depth that is seen, in heights of the view
  const [LIGHT, AMBIENT] = [2.1, 1.75];
  const FAINT = 0.3; // of the bodies of another run
  const NEAR = 14; // a pointer that misses a body by so many pixels still takes it
  const stage = { view, failed: "" };

  function isSoftware() {
    const probe = document.createElement("canvas").getContext("webgl2");
    const about = probe?.getExtension("WEBGL_debug_renderer_info");
    const name = about ? `${probe.getParameter(about.UNMASKED_RENDERER_WEBGL)}` : "";
    probe?.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|software/i.test(name);
  }

  // Software in place of a graphics card takes three times as long to smooth edges, which only a
  // picture that stands still is worth.
  const smooth = !isSoftware() || location.hash.includes("still");
  const context = canvas.getContext("webgl2", { antialias: smooth, alpha: false });
  const renderer = context ? new THREE.WebGLRenderer({ canvas, context, antialias: true }) : null;
  if (!renderer) {
    stage.failed = "This browser offers no WebGL, so the picture cannot be drawn; values, plots and controls work without it.";
  }
  const scene = new THREE.Scene();
  const camera = new THREE.OrthographicCamera();
  const sun = new THREE.DirectionalLight(0xffffff, LIGHT);
  scene.add(sun, sun.target, new THREE.AmbientLight(0xffffff, AMBIENT));
  let size = [1, 1];
  let now = null; // what was drawn last

  // ---- Colours ----

  const [paper, ink] = [new THREE.Color("#ffffff"), new THREE.Color("#000000")];
  // Mixed as a screen does, so that a mixture is as strong on dark paper as on light.
  const mixed = (strength) => {
    const [from, to] = [paper, ink].map((color) => color.clone().convertLinearToSRGB());
    return from.lerp(to, strength).convertSRGBToLinear();
  };
  const world = makeWorld(scene, mixed);
  const elements = makeElements(scene, mixed);
  const traces = makeTraces(scene, () => paper);
  const marks = makeMarks(scene, () => paper, mixed);
  const arrows = makeArrows(scene, mechanism);
  const shadow = new THREE.MeshBasicMaterial({ depthWrite: false });
  const grip = lines.make({ color: "#e08a00", width: 2.5 });
  grip.renderOrder = 90;
  scene.add(grip);
  let theme = 0; // how often colours were set

  stage.setTheme = () => {
    paper.set(drawing.camera.background ?? getComputedStyle(canvas.parentElement).backgroundColor);
    const dark = 0.2126 * paper.r + 0.7152 * paper.g + 0.0722 * paper.b < 0.18;
    ink.set(dark ? "#ffffff" : "#000000");
    canvas.parentElement.dataset.ink = dark ? "light" : "dark";
    scene.background = paper;
    shadow.color.copy(paper).multiplyScalar(dark ? 0.45 : 0.8); // darker on a dark floor too
    theme += 1;
    for (const part of [world, ghosts, elements, traces, marks]) part.paint();
  };

  // ---- Bodies, their shadows, and the faint ones of another run ----

  const solids = makeBodies(scene, (shape, geometry, index, k, count) => shapes.objects(shape, geometry).map((object, layer) => {
    object.userData.body = index;
    if (layer) object.raycast = () => {};
    return Object.assign(object, { renderOrder: index + (k + layer / 2) / (count + 1) });
  }));
  const casts = drawing.floor ? makeBodies(scene, (shape, geometry) => {
    const [flat] = shapes.objects(shape, geometry);
    flat.raycast = () => {};
    return [Object.assign(flat, { material: shadow, renderOrder: -55 })];
  }) : null;
  const ghosts = makeBodies(scene, (shape, geometry, index) => {
    const [mesh] = shapes.objects(shape, geometry);
    mesh.material = mesh.material.clone();
    // In the plane what is drawn first is behind; what is transparent would be drawn last.
    if (space) Object.assign(mesh.material, { transparent: true, opacity: FAINT, depthWrite: false });
    else mesh.material.color.lerp(paper, 1 - FAINT);
    return [Object.assign(mesh, { renderOrder: index / drawing.bodies.length - 9 })];
  });

  function placeBodies(looked, other) {
    solids.draw(looked);
    ghosts.draw(other && look(other));
    const hasShadows = looked.seen.shadows && view.axes()[2][2] > 0;
    casts?.draw(hasShadows ? looked : null);
    if (!hasShadows) return;
    // Straight down onto the floor.
    const down = new THREE.Matrix4().set(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1e-6, world.floorLevel(), 0, 0, 0, 1);
    casts?.groups.forEach((group) => group.matrix.premultiply(down));
  }

  // ---- The camera ----

  function aimCamera() {
    const [right, up, near] = view.axes();
    const middle = view.middle();
    const [width, height] = size.map((pixels) => pixels / view.scale());
    const far = DEEP * Math.max(view.height, height, width);
    camera.left = -width / 2;
    camera.right = width / 2;
    camera.top = height / 2;
    camera.bottom = -height / 2;
    camera.near = 0;
    camera.far = far;
    camera.position.set(...tools.add(middle, tools.scaled(near, far / 2)));
    camera.up.set(...up);
    camera.lookAt(...middle);
    camera.updateProjectionMatrix();
    // The light comes over the eye's left shoulder.
    const light = [0, 1, 2].map((k) => -0.45 * right[k] + 0.75 * up[k] + 0.65 * near[k]);
    sun.position.set(...tools.add(middle, light));
    sun.target.position.set(...middle);
  }

  function resize() {
    size = [canvas.clientWidth || 1, canvas.clientHeight || 1];
    lines.setSize(...size);
    if (!renderer) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const wanted = size.map((length) => Math.round(length * ratio));
    if (canvas.width === wanted[0] && canvas.height === wanted[1]) return;
    renderer.setPixelRatio(ratio);
    renderer.setSize(...size, false);
  }

  // What is needed of a state to draw it; arrays are copies.
  function look(given, seen = {}) {
    const [t, , p] = given;
    const geometry = mechanism.geometry ? Float64Array.from(mechanism.geometry(p, t)) : DATA.geometry ?? [];
    return { given, geometry, values: geometry, poses: Float64Array.from(mechanism.bodyPoses(...given)), seen, view };
  }

  // Draw a state. `show` says what: traces, joints, centres, forces, torques, velocities, reactions,
  // shadows; `pull` is [point, target] in the world while a body is pulled. With `keep`, the view
  // follows a mechanism that would leave the picture. `other` is the state of another run, which is faint.
  stage.draw = (t, y, p, u, show, { pull = null, keep = false, other = null } = {}) => {
    now = look([t, y, p, u], show);
    if (!pull) view.aim(now.poses); // what the pointer pulls to stays under it
    resize();
    if (keep && !pull && view.follow === null && isGone()) {
      view.follow = drawing.joints.findIndex(({ parent }) => parent < 0);
      view.aim(now.poses);
    }
    if (!renderer) return;
    now.pixel = 1 / view.scale();
    world.draw(view, size, now.poses, now.values, t, theme);
    placeBodies(now, other);
    elements.draw(now);
    traces.draw(show, t);
    marks.draw(now, show);
    arrows.draw(now, show);
    grip.visible = Boolean(pull);
    if (pull) grip.setPoints(pull.flatMap((point) => vector(point, [])));
    aimCamera();
    renderer.render(scene, camera);
  };

  // What was drawn last, as SVG;
  stage.toSvg = () => vectors.picture(scene, view, size, paper.getStyle(),
    { sun: sun.position.clone().sub(sun.target.position).toArray(), light: LIGHT, ambient: AMBIENT }, DATA.heading);

  // Whether the centres of mass of all bodies are out of the picture.
  const isGone = () => drawing.bodies.every((_, k) => {
    const [x, y] = view.toScreen(center(now.poses, k));
    return x < 0 || y < 0 || x > size[0] || y > size[1];
  });

  // ---- Traces and scales of arrows ----

  stage.loadTraces = (times, stateAt) => traces.load(times, (i) => look(stateAt(i)));
  stage.clearTraces = () => traces.clear();
  stage.appendTraces = (given) => {
    const { poses, geometry } = look(given);
    traces.append(poses, geometry);
  };
  stage.calibrate = (states) => arrows.calibrate(states.map((given) => look(given)));
  stage.legend = (show) => arrows.legend(show);

  // ---- From the screen to the world ----

  stage.toScreen = (point) => view.toScreen(vector(point, []));
  stage.toWorld = (x, y, through) => view.toWorld(x, y, through && vector(through, []));
  stage.poses = () => now?.poses ?? new Float64Array(0);
  const caster = new THREE.Raycaster();

  function hit(x, y) {
    const [right, up] = [(2 * x) / size[0] - 1, 1 - (2 * y) / size[1]];
    camera.updateMatrixWorld();
    caster.setFromCamera(new THREE.Vector2(right, up), camera);
    const found = caster.intersectObjects(solids.groups, true);
    if (!found.length) return null;
    // In the plane all are equally near: the one drawn last is in front.
    return space ? found[0] : found.reduce((a, b) => (b.object.renderOrder > a.object.renderOrder ? b : a));
  }

  // The effect whose arrow is within so many pixels of a place of the picture, or null.
  stage.effectAt = (x, y, near) => arrows.effectAt([x, y], near, view.toScreen);

  // The body at a place of the picture: {body, at: the point in its axes, world}, or null.
  stage.pick = (x, y) => {
    if (!now) return null;
    scene.updateMatrixWorld();
    for (const [dx, dy] of [[0, 0], [0.6, 0], [-0.6, 0], [0, 0.6], [0, -0.6], [0.7, 0.7], [-0.7, 0.7], [0.7, -0.7], [-0.7, -0.7]]) {
      const found = renderer && hit(x + dx * NEAR, y + dy * NEAR);
      if (!found) continue;
      const { body } = found.object.userData;
      const world = [found.point.x, found.point.y, space ? found.point.z : 0];
      return { body, world, at: tools.pointOf(now.poses, body, world) };
    }
    // A body without shapes is a dot.
    const near = drawing.bodies.findIndex((_, k) => {
      const [a, b] = view.toScreen(center(now.poses, k));
      return Math.hypot(a - x, b - y) < NEAR;
    });
    return near < 0 ? null : { body: near, world: center(now.poses, near), at: space ? [0, 0, 0] : [0, 0] };
  };
  stage.fit = () => view.home();
  stage.setTheme();
  return stage;
};

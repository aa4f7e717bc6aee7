// `makePointer`: mouse, pen and fingers on the picture. A body is pulled where it is touched, if it
// can be; beside bodies one finger turns the view in space or moves it in the plane, two fingers move
// and zoom it. A click on the arrow of an effect lights it up.

const makePointer = (canvas, stage, { canPull, pull, release, light, redraw }) => {
  const { space } = tools;
  const CLICK = 4; // pixels that a click may move
  const [FINE, COARSE] = [7, 18]; // pixels from an arrow within which a mouse or pen means it, and a finger
  const touches = new Map(); // where each finger is
  let grip = null; // {body, at, world} of the pulled body
  let spread = 0; // distance of two fingers
  let arrow = null; // {effect, spot} that was pressed and has not been dragged from
  let [chosen, aim] = [-1, [0, 0]]; // the body taken by keys, and where it is pulled to

  const spotOf = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    touches.set(event.pointerId, spotOf(event));
    if (touches.size > 1) {
      arrow = null;
      letGo();
      spread = distance();
      return;
    }
    if (event.button !== 0 || event.shiftKey) return;
    const spot = spotOf(event);
    const effect = stage.effectAt(...spot, event.pointerType === "touch" ? COARSE : FINE);
    if (effect) arrow = { effect, spot };
    else takeAt(spot);
  });

  function takeAt(spot) {
    if (canPull()) grip = stage.pick(...spot);
    if (!grip) return;
    canvas.dataset.grip = grip.body;
    pull(grip, grip.world);
  }

  const distance = () => {
    const [a, b] = [...touches.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };

  canvas.addEventListener("pointermove", (event) => {
    const before = touches.get(event.pointerId);
    const here = spotOf(event);
    if (!before) {
      if (event.pointerType === "mouse") canvas.classList.toggle("over", Boolean(stage.effectAt(...here, FINE) || (canPull() && stage.pick(...here))));
      return;
    }
    if (arrow) {
      const { spot } = arrow;
      if (Math.hypot(here[0] - spot[0], here[1] - spot[1]) <= CLICK) return;
      arrow = null;
      takeAt(spot);
    }
    touches.set(event.pointerId, here);
    const [dx, dy] = [here[0] - before[0], here[1] - before[1]];
    if (grip) pull(grip, stage.toWorld(...here, grip.world));
    else if (touches.size === 2) {
      const next = distance();
      stage.view.move(dx / 2, dy / 2);
      if (spread > 0) stage.view.zoomBy(next / spread, ...here);
      spread = next;
    } else if (space && event.buttons === 1 && !event.shiftKey) stage.view.turn(dx, dy);
    else stage.view.move(dx, dy);
    redraw();
  });

  function letGo() {
    if (!grip) return;
    grip = null;
    delete canvas.dataset.grip;
    release();
  }
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => {
      touches.delete(event.pointerId);
      if (arrow && name === "pointerup") light(arrow.effect);
      arrow = null;
      if (!touches.size) letGo();
    });
  }

  // The same by keys: take the next body at its centre of mass, then pull it about.
  function take(direction) {
    if (!canPull()) return;
    const count = DATA.bodies.length;
    chosen = (chosen + direction + count) % count;
    letGo();
    const world = tools.center(stage.poses(), chosen);
    grip = { body: chosen, world, at: space ? [0, 0, 0] : [0, 0] };
    aim = stage.toScreen(world);
    canvas.dataset.grip = chosen;
    pull(grip, world);
    redraw();
  }
  function nudge(dx, dy) {
    aim = [aim[0] + dx, aim[1] + dy];
    pull(grip, stage.toWorld(...aim, grip.world));
    redraw();
  }

  canvas.addEventListener("contextmenu", (event) => event.preventDefault()); // the right button moves the view
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    stage.view.zoomBy(Math.exp(-0.0015 * event.deltaY), ...spotOf(event));
    redraw();
  }, { passive: false });
  return { letGo, take, nudge, held: () => grip };
};

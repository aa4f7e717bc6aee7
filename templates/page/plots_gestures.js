// `plotGestures` turns what is done with pointers and keys on a plot into few actions:
//   hover(x, y), leave()             where a mouse is, CSS pixels from the top left of the plot
//   seek(x, y)                       a click, or a drag of the time mark, or of a finger
//   isMark(x, y)                     whether the time mark is there to be dragged
//   select(x0, y0, x1, y1, isFinal)  an area dragged over
//   zoom(factor, x, y), pan(dx, dy), reset()
//   step(n), end(direction)          by keys
//   nudge(dx, dy)                    by arrow keys in place of these; whether it did so. A plot may lack it

const plotGestures = (over, focusable, actions) => {
  const CLICK = 4; // CSS pixels that a click may move
  const pointers = new Map();
  let drag = null; // {kind: "seek" | "select" | "pan" | "pinch", x, y, moved}

  const place = (event) => {
    const box = over.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  function spread() {
    const [[ax, ay], [bx, by]] = [...pointers.values()];
    return { distance: Math.max(Math.hypot(ax - bx, ay - by), 1), x: (ax + bx) / 2, y: (ay + by) / 2 };
  }

  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse" && event.button !== 0 && event.button !== 1) return;
    const [x, y] = place(event);
    pointers.set(event.pointerId, [x, y]);
    over.setPointerCapture(event.pointerId);
    if (pointers.size === 2) drag = { kind: "pinch", ...spread(), moved: true };
    else {
      const touch = event.pointerType === "touch";
      let kind = touch || actions.isMark(x, y) ? "seek" : "select";
      if (event.shiftKey || event.button === 1) kind = "pan";
      drag = { kind, x, y, moved: false, fromX: x, fromY: y };
    }
    if (event.button === 1) event.preventDefault();
    focusable.focus({ preventScroll: true });
  });

  over.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    if (!pointers.has(event.pointerId)) {
      if (event.pointerType === "mouse") {
        over.style.cursor = actions.isMark(x, y) ? "ew-resize" : "";
        actions.hover(x, y);
      }
      return;
    }
    pointers.set(event.pointerId, [x, y]);
    if (!drag) return;
    if (drag.kind === "pinch") {
      if (pointers.size < 2) return;
      const now = spread();
      actions.zoom(now.distance / drag.distance, now.x, now.y);
      actions.pan(now.x - drag.x, now.y - drag.y);
      Object.assign(drag, now);
      return;
    }
    drag.moved ||= Math.hypot(x - drag.fromX, y - drag.fromY) > CLICK;
    if (!drag.moved) return;
    if (drag.kind === "seek") actions.seek(x, y);
    else if (drag.kind === "pan") actions.pan(x - drag.x, y - drag.y);
    else actions.select(drag.fromX, drag.fromY, x, y, false);
    Object.assign(drag, { x, y });
  });

  function end(event, finished) {
    if (!pointers.delete(event.pointerId) || !drag) return;
    const [x, y] = place(event);
    if (drag.kind === "select" && drag.moved) actions.select(drag.fromX, drag.fromY, x, y, true, finished);
    else if (finished && !drag.moved && drag.kind !== "pan") actions.seek(x, y);
    if (!pointers.size || drag.kind !== "pinch") drag = null;
  }
  over.addEventListener("pointerup", (event) => end(event, true));
  over.addEventListener("pointercancel", (event) => end(event, false));
  over.addEventListener("pointerleave", () => { if (!pointers.size) actions.leave(); });
  over.addEventListener("dblclick", () => actions.reset());
  over.addEventListener("wheel", (event) => {
    event.preventDefault();
    const [x, y] = place(event);
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      actions.pan(-(event.deltaX || event.deltaY), 0);
    } else actions.zoom(Math.exp(-0.0015 * event.deltaY), x, y);
  }, { passive: false });

  const middle = () => [over.clientWidth / 2, over.clientHeight / 2];
  const keys = {
    ArrowLeft: (shift) => (shift ? actions.pan(40, 0) : actions.nudge?.(-1, 0) || actions.step(-1)),
    ArrowRight: (shift) => (shift ? actions.pan(-40, 0) : actions.nudge?.(1, 0) || actions.step(1)),
    ArrowUp: (shift) => (shift ? actions.pan(0, 40) : actions.nudge?.(0, -1) ?? false),
    ArrowDown: (shift) => (shift ? actions.pan(0, -40) : actions.nudge?.(0, 1) ?? false),
    Home: () => actions.end(-1),
    End: () => actions.end(1),
    "+": () => actions.zoom(1.25, ...middle()),
    "=": () => actions.zoom(1.25, ...middle()),
    "-": () => actions.zoom(0.8, ...middle()),
    0: () => actions.reset(),
    Escape: () => actions.reset(),
  };
  focusable.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target !== focusable) return;
    const act = keys[event.key];
    if (!act || act(event.shiftKey) === false) return;
    event.preventDefault();
    event.stopPropagation(); // the page has keys of its own
  });
};

// `listenToKeys`: everything on the page can be done with the keys alone.

const listenToKeys = ({ canvas, stage, setPlaying, step, goTo, reset, zoom, redraw, pointer, clock, replay, isLive }) => {
  const { space } = tools;
  const FAR = 40; // pixels by which a key moves the view
  const view = (action) => () => {
    action();
    redraw();
  };
  const move = (dx, dy) => view(() => stage.view.move(dx, dy));
  const turn = (dx, dy) => view(() => (space ? stage.view.turn(dx, dy) : stage.view.move(dx, dy)));
  const press = (id) => () => document.getElementById(id).click();
  const keys = {
    " ": () => setPlaying(!clock.playing),
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    Home: () => (isLive() ? reset() : goTo(replay.begin)),
    End: () => replay && goTo(replay.end),
    "+": () => zoom(1.25),
    "=": () => zoom(1.25),
    "-": () => zoom(0.8),
    0: view(stage.fit),
    r: reset,
    l: () => press(isLive() ? "mode-replay" : "mode-live")(),
    t: press("theme"),
    b: () => pointer.take(1),
    a: move(FAR, 0),
    d: move(-FAR, 0),
    w: move(0, FAR),
    s: move(0, -FAR),
  };
  if (space) {
    Object.assign(keys, {
      1: view(() => stage.view.lookFrom(-90, 0)),
      2: view(() => stage.view.lookFrom(0, 0)),
      3: view(() => stage.view.lookFrom(-90, 90)),
    });
  }
  const pull = { ArrowLeft: [-FAR, 0], ArrowRight: [FAR, 0], ArrowUp: [0, -FAR], ArrowDown: [0, FAR] };
  const shifted = {
    B: () => pointer.take(-1),
    ArrowLeft: turn(FAR, 0),
    ArrowRight: turn(-FAR, 0),
    ArrowUp: turn(0, FAR),
    ArrowDown: turn(0, -FAR),
  };

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === "Escape") {
      pointer.letGo();
      const menu = document.querySelector("details.menu[open]");
      if (menu) {
        menu.open = false;
        menu.querySelector("summary").focus();
      } else if (document.activeElement !== canvas) document.activeElement.blur();
      return;
    }
    // Fields, lists and sliders use these keys themselves; on a button, space presses it.
    const within = event.target.closest("select, input[type=text], input[type=range], textarea, [data-keys]");
    if (within && within.id !== "time") return;
    if (within && event.key !== " ") return;
    if (event.key === " " && event.target.closest("button, summary, input[type=checkbox]")) return;
    const pulled = !event.shiftKey && pointer.held() && pull[event.key];
    const action = pulled ? () => pointer.nudge(...pulled) : (event.shiftKey && shifted[event.key]) || keys[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
};

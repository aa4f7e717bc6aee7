// `makeView`: what part of the world the picture shows. There is no perspective: equal lengths look
// equal everywhere, and the scale bar holds for the whole picture. The eye's axes point to the right,
// up, and towards the eye; lengths on the screen are in CSS pixels.

const makeView = (canvas) => {
  const { add, dot, scaled, space } = tools;
  const { camera } = DATA.drawing;
  const NARROW = 4 / 3; // a narrow window shows at least this much width for the camera's height
  const TURN = 0.4; // degrees for a pixel
  const home = { zoom: 1, x: 0, y: 0, azimuth: camera.azimuth ?? -60, elevation: camera.elevation ?? 20 };
  const view = {
    ...home,
    follow: camera.follow ?? null,
    focus: [0, 0, 0],
    height: camera.height,
    width: camera.width || 0,
  };

  view.axes = () => {
    if (!space) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const [azimuth, elevation] = [view.azimuth, view.elevation].map((angle) => (angle * Math.PI) / 180);
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
  };

  // Pixels for a metre.
  view.scale = () => {
    const [width, height] = [canvas.clientWidth || 1, canvas.clientHeight || 1];
    const across = view.width || view.height * NARROW;
    return Math.min(height / view.height, width / across) * view.zoom;
  };

  // Look at the body that the camera follows, or at its fixed centre.
  view.aim = (poses) => {
    const offset = camera.center ?? [0, 0, 0];
    const own = view.follow === (camera.follow ?? null);
    view.focus = view.follow === null ? add([0, 0, 0], own ? offset : camera.center ?? [0, 0, 0])
      : add(tools.center(poses, view.follow), own ? offset : [0, 0, 0]);
  };

  // The point at the middle of the picture.
  view.middle = () => {
    const [right, up] = view.axes();
    return add(view.focus, add(scaled(right, view.x), scaled(up, view.y)));
  };

  view.toScreen = (point) => {
    const [right, up] = view.axes();
    const [middle, scale] = [view.middle(), view.scale()];
    return [
      canvas.clientWidth / 2 + (dot(right, point) - dot(right, middle)) * scale,
      canvas.clientHeight / 2 - (dot(up, point) - dot(up, middle)) * scale,
    ];
  };

  // The point of the world at a place of the picture, in the plane of the screen through a point.
  view.toWorld = (x, y, through = view.middle()) => {
    const [right, up] = view.axes();
    const [left, top] = view.toScreen(through);
    const scale = view.scale();
    return add(through, add(scaled(right, (x - left) / scale), scaled(up, (top - y) / scale)));
  };

  view.zoomBy = (factor, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) => {
    const before = 1 / view.scale();
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.01), 1000);
    const gained = before - 1 / view.scale();
    // The point under the pointer stays under it.
    view.x += (x - canvas.clientWidth / 2) * gained;
    view.y -= (y - canvas.clientHeight / 2) * gained;
  };
  view.move = (dx, dy) => {
    view.x -= dx / view.scale();
    view.y += dy / view.scale();
  };
  view.turn = (dx, dy) => {
    view.azimuth -= TURN * dx;
    view.elevation = Math.min(Math.max(view.elevation + TURN * dy, -90), 90);
  };
  view.lookFrom = (azimuth, elevation) => Object.assign(view, { azimuth, elevation });
  view.home = () => Object.assign(view, home, { follow: camera.follow ?? null });
  return view;
};

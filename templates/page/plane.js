// Draws the mechanism in the plane; a pose is [x, y, angle].

const HOME = { zoom: 1, x: 0, y: 0 };
const turn = null; // a plane is seen from one side only
const positionOf = (pose) => [pose[0], pose[1]];

function centerOfView(poses) {
  const [x, y] = run.camera.follow === null ? run.camera.center : poses[run.camera.follow];
  return [x + view.x, y + view.y];
}

function drawScene(poses, upTo, { scale, ratio, width, height }) {
  const [x, y] = centerOfView(poses);
  // In metres, y up; `pixel` is the size of a pixel.
  const pixel = 1 / scale;
  pen.setTransform(ratio * scale, 0, 0, -ratio * scale,
    ratio * (width / 2 - x * scale), ratio * (height / 2 + y * scale));
  drawGrid(x, y, width / scale / 2, height / scale / 2, pixel);
  drawPlanes(x, y, Math.hypot(width, height) * pixel, pixel);
  drawBalls(1, pixel, (center) => center);
  if (byId("trace").checked) drawTraces(upTo, poses, pixel, (position) => position);
  poses.forEach((pose, body) => drawBody(body, pose, pixel));
  for (const [body, ax, ay] of markRadius() > 1.5 ? run.anchors : []) drawAnchor(poses[body], ax, ay, pixel);
}

function drawGrid(x, y, halfWidth, halfHeight, pixel) {
  const step = roundLength(GRID * pixel);
  pen.lineWidth = pixel;
  const line = (order, from, to) => {
    pen.strokeStyle = `rgba(${ink}, ${order === 0 ? 0.28 : 0.08})`;
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  };
  const [left, right, low, high] = [x - halfWidth, x + halfWidth, y - halfHeight, y + halfHeight];
  for (let i = Math.ceil(left / step); i * step <= right; i++) line(i, [i * step, low], [i * step, high]);
  for (let i = Math.ceil(low / step); i * step <= high; i++) line(i, [left, i * step], [right, i * step]);
}

// Shade the half-planes behind contact planes, up to the distance `far` from the view's centre x, y.
function drawPlanes(x, y, far, pixel) {
  const ends = (run.planes ?? []).map(({ normal: [nx, ny], offset }) => {
    const gap = nx * x + ny * y - offset;
    const [footX, footY] = [x - gap * nx, y - gap * ny];
    const depth = far + Math.abs(gap);
    return [
      [footX + far * ny, footY - far * nx],
      [footX - far * ny, footY + far * nx],
      [footX - far * ny - depth * nx, footY + far * nx - depth * ny],
      [footX + far * ny - depth * nx, footY - far * nx - depth * ny],
    ];
  });
  pen.fillStyle = `rgba(${ink}, ${FILL})`;
  pen.strokeStyle = `rgba(${ink}, ${SURFACE})`;
  pen.lineWidth = 1.4 * pixel;
  pen.beginPath(); // one for all, so that what lies behind two planes is not darker
  for (const corners of ends) {
    corners.forEach((corner, k) => (k ? pen.lineTo(...corner) : pen.moveTo(...corner)));
    pen.closePath();
  }
  pen.fill();
  for (const [from, to] of ends) {
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
  }
}

function drawBody(body, [x, y, angle], pixel) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(angle);
  for (const shape of run.shapes[body]) drawShape(shape, pixel);
  pen.beginPath();
  pen.arc(0, 0, (run.shapes[body].length ? dotRadius() : 6) * pixel, 0, 2 * Math.PI);
  pen.fillStyle = run.shapes[body].length ? `rgba(${ink}, 0.55)` : run.colors[body];
  pen.fill();
  pen.restore();
}

function drawShape(shape, pixel) {
  pen.fillStyle = shape.color;
  pen.beginPath();
  if (shape.type === "rod") {
    pen.lineCap = "round";
    pen.moveTo(...shape.start);
    pen.lineTo(...shape.end);
    // The edge is a wider line drawn below it.
    for (const [width, color] of [[pixel, `rgba(${ink}, 0.35)`], [-pixel, shape.color]]) {
      pen.lineWidth = Math.max(shape.width + width, pixel);
      pen.strokeStyle = color;
      pen.stroke();
    }
    return;
  }
  pen.save();
  if (shape.type === "disc") {
    pen.arc(...shape.center, shape.radius, 0, 2 * Math.PI);
  } else if (shape.type === "box") {
    const [width, height] = shape.size;
    pen.translate(...shape.center);
    pen.rotate(shape.angle);
    pen.rect(-width / 2, -height / 2, width, height);
  } else {
    for (const point of shape.points) pen.lineTo(...point);
    pen.closePath();
  }
  pen.fill();
  pen.lineWidth = pixel;
  pen.strokeStyle = `rgba(${ink}, 0.35)`;
  pen.stroke();
  if (shape.type === "disc") {
    // A spoke makes the rotation of a disc visible.
    pen.beginPath();
    pen.moveTo(...shape.center);
    pen.lineTo(shape.center[0] + shape.radius, shape.center[1]);
    pen.stroke();
  }
  pen.restore();
}

function drawAnchor([x, y, angle], ax, ay, pixel) {
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  pen.beginPath();
  pen.arc(x + cos * ax - sin * ay, y + sin * ax + cos * ay, markRadius() * pixel, 0, 2 * Math.PI);
  pen.fillStyle = run.camera.background;
  pen.strokeStyle = `rgba(${ink}, 0.8)`;
  pen.lineWidth = 1.6 * pixel;
  pen.fill();
  pen.stroke();
}

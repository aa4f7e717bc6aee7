// Draws the mechanism in space, without perspective. A pose is the three rows of [world_R_body |
// position]; the eye's axes are right, up, and towards the eye.

const HOME = { zoom: 1, x: 0, y: 0, azimuth: run.camera.azimuth, elevation: run.camera.elevation };
const AXES = [["x", "#cc3311"], ["y", "#228833"], ["z", "#3366cc"]];
const WORLD = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const TURN = 0.4; // degrees for a pixel

const positionOf = (pose) => [pose[0][3], pose[1][3], pose[2][3]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

function turn(dx, dy) {
  view.azimuth -= TURN * dx;
  view.elevation = Math.min(Math.max(view.elevation + TURN * dy, -90), 90);
  requestAnimationFrame(draw);
}

function lookFrom(azimuth, elevation) {
  Object.assign(view, { azimuth, elevation });
  requestAnimationFrame(draw);
}

function eyeAxes() {
  const [azimuth, elevation] = [view.azimuth, view.elevation].map((angle) => (angle * Math.PI) / 180);
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
}

function drawScene(poses, upTo, { scale, width, height }) {
  const axes = eyeAxes();
  const center = run.camera.follow === null ? run.camera.center : positionOf(poses[run.camera.follow]);
  const left = width / 2 - (dot(axes[0], center) + view.x) * scale;
  const top = height / 2 + (dot(axes[1], center) + view.y) * scale;
  const toPicture = (point) => [left + scale * dot(axes[0], point), top - scale * dot(axes[1], point)];
  if (axes[2][2] > 0) drawShadow(poses, toPicture); // from below the floor it is not seen
  drawFloor(toPicture);
  drawPatches(toPicture);
  drawBalls(scale, 1, toPicture);
  if (byId("trace").checked) drawTraces(upTo, poses, 1, toPicture);
  startRaster(width, height);
  drawSolids(poses, axes, scale, left, top);
  layRaster(width, height);
  poses.forEach((pose, body) => {
    if (!run.solids[body].length) drawDot(toPicture(positionOf(pose)), 6, run.colors[body], run.camera.background);
  });
  for (const [body, ...r] of markRadius() > 1.5 ? run.anchors : []) {
    const spot = poses[body].map((row) => dot(row, r) + row[3]);
    drawDot(toPicture(spot), 0.8 * markRadius(), run.camera.background, `rgba(${ink}, 0.8)`);
  }
  drawCross(axes, width, height);
}

// Shadows of the bodies on the floor: their upward faces, projected vertically.
function drawShadow(poses, toPicture) {
  const { z } = run.floor;
  const [left, top] = toPicture([0, 0, z]);
  const [[ax, ay], [bx, by]] = [[1, 0, z], [0, 1, z]].map(toPicture).map(([x, y]) => [x - left, y - top]);
  pen.fillStyle = `rgba(${ink}, 0.1)`;
  pen.beginPath();
  for (const { body, mesh } of solids) {
    placeCorners(mesh, WORLD, poses[body]);
    findFront(mesh);
    for (let face = 0; 4 * face < mesh.faces.length; face++) {
      if (!front[face]) continue;
      for (let k = 0; k < 4; k++) {
        const corner = 3 * mesh.faces[4 * face + k];
        const x = left + ax * spots[corner] + bx * spots[corner + 1];
        const y = top + ay * spots[corner] + by * spots[corner + 1];
        if (k) pen.lineTo(x, y);
        else pen.moveTo(x, y);
      }
      pen.closePath();
    }
  }
  pen.fill();
}

function drawFloor(toPicture) {
  pen.lineWidth = 1;
  run.floor.lines.forEach(([from, to], i) => {
    pen.strokeStyle = `rgba(${ink}, ${run.floor.through_origin[i] ? 0.3 : 0.1})`;
    pen.beginPath();
    pen.moveTo(...toPicture(from));
    pen.lineTo(...toPicture(to));
    pen.stroke();
  });
}

// Draw squares for contact planes other than the floor; they are drawn without hiding anything.
function drawPatches(toPicture) {
  pen.fillStyle = `rgba(${ink}, ${FILL / 2})`;
  pen.strokeStyle = `rgba(${ink}, ${SURFACE})`;
  pen.lineWidth = 1;
  for (const corners of run.patches ?? []) {
    pen.beginPath();
    for (const corner of corners) pen.lineTo(...toPicture(corner));
    pen.closePath();
    pen.fill();
    pen.stroke();
  }
}

function drawDot([x, y], radius, fill, line) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = fill;
  pen.strokeStyle = line;
  pen.lineWidth = Math.min(1.4, 0.4 * radius);
  pen.fill();
  pen.stroke();
}

// Draw the axes x, y and z in a corner; the one that points at the viewer is drawn last.
function drawCross(axes, width, height) {
  const [x, y, size] = [width - 52, height - 50, 30];
  pen.lineWidth = 2;
  pen.lineCap = "round";
  pen.font = "600 13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  for (const k of [0, 1, 2].sort((a, b) => axes[2][a] - axes[2][b])) {
    const [name, color] = AXES[k];
    const [dx, dy] = [size * axes[0][k], -size * axes[1][k]];
    pen.strokeStyle = pen.fillStyle = color;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(x + dx, y + dy);
    pen.stroke();
    pen.fillText(name, x + 1.36 * dx, y + 1.36 * dy);
  }
  pen.textAlign = "left";
  pen.textBaseline = "alphabetic";
}

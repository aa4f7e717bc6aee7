// Bodies as meshes: unpacked once, rotated, shaded, and drawn by the rasteriser.

const LEVELS = 48; // shades of a colour
const EDGE = 0.6; // how dark edges are, between the body's colour and ink
const THICK = 4; // CSS pixels; what is thinner has edges of its own colour, or nothing else is seen

const meshes = run.meshes.map((mesh) => ({
  vertices: new Float32Array(bytesOf(mesh.vertices)),
  faces: new Int16Array(bytesOf(mesh.faces)), // four corners each, counter-clockwise from outside
  across: new Int16Array(bytesOf(mesh.across)), // the face beyond each side, -1 at a sharp edge
  thickness: mesh.thickness,
}));
const solids = run.solids.flatMap((parts, body) =>
  parts.map(([mesh, color]) => ({ body, mesh: meshes[mesh], ...coloursOf(color) })));

// Buffers for one mesh: positions of its corners, which faces are visible, and their brightness.
const most = Math.max(0, ...meshes.map((mesh) => mesh.faces.length / 4));
const spots = new Float64Array(Math.max(0, ...meshes.map((mesh) => mesh.vertices.length)));
const front = new Uint8Array(most);
const light = new Float64Array(most);

// The colour for each brightness, from dark to light, and that of edges.
function coloursOf(color) {
  const rgb = [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16));
  const shades = Array.from({ length: LEVELS + 1 }, (_, level) => {
    const share = level / LEVELS;
    const part = run.light.ambient + (1 - run.light.ambient) * share;
    return packed(...rgb.map((c) => Math.min(255, Math.round(c * part + 255 * run.light.gloss * share ** 4))));
  });
  const inked = ink.split(", ").map(Number);
  return {
    shades,
    plain: packed(...rgb),
    edge: packed(...rgb.map((c, k) => Math.round(EDGE * inked[k] + (1 - EDGE) * c))),
  };
}

// Coordinates of a mesh's corners along three axes.
function placeCorners({ vertices }, axes, pose) {
  const turned = axes.map((axis) =>
    [0, 1, 2, 3].map((k) => axis[0] * pose[0][k] + axis[1] * pose[1][k] + axis[2] * pose[2][k]));
  for (let i = 0; i < vertices.length; i += 3) {
    for (let k = 0; k < 3; k++) {
      const [a, b, c, d] = turned[k];
      spots[i + k] = a * vertices[i] + b * vertices[i + 1] + c * vertices[i + 2] + d;
    }
  }
}

// Which faces are turned towards the third axis, and their brightness. It allocates no arrays, because
// it runs for every face of every picture.
function findFront({ faces }) {
  const [lx, ly, lz] = run.light.toward;
  for (let face = 0; 4 * face < faces.length; face++) {
    const a = 3 * faces[4 * face];
    const b = 3 * faces[4 * face + 1];
    const c = 3 * faces[4 * face + 2];
    const d = 3 * faces[4 * face + 3];
    const ux = spots[c] - spots[a];
    const uy = spots[c + 1] - spots[a + 1];
    const uz = spots[c + 2] - spots[a + 2];
    const vx = spots[d] - spots[b];
    const vy = spots[d + 1] - spots[b + 1];
    const vz = spots[d + 2] - spots[b + 2];
    const nx = uy * vz - uz * vy; // the normal is along the product of the diagonals
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    front[face] = nz > 0;
    light[face] = Math.max(0, (lx * nx + ly * ny + lz * nz) / Math.sqrt(nx * nx + ny * ny + nz * nz));
    slopes[2 * face] = -nx / nz;
    slopes[2 * face + 1] = -ny / nz;
  }
}

const slopes = new Float64Array(2 * most); // of the nearness, with a step to the right and one up
const cornerX = new Float64Array(4);
const cornerY = new Float64Array(4);

// Draw all solids; `scale`, `left` and `top` map metres in view axes to pixels of the picture.
function drawSolids(poses, axes, scale, left, top) {
  const { ratio } = raster;
  const size = scale * ratio; // all in pixels of the sheet from here on, nearness too
  for (const { body, mesh, shades, edge, plain } of solids) {
    placeCorners(mesh, axes, poses[body]);
    findFront(mesh);
    const { faces, across } = mesh;
    for (let i = 0; i < mesh.vertices.length; i += 3) {
      spots[i] = left * ratio + size * spots[i];
      spots[i + 1] = top * ratio - size * spots[i + 1];
      spots[i + 2] *= size;
    }
    const lineColor = mesh.thickness * scale > THICK ? edge : plain;
    for (let face = 0; 4 * face < faces.length; face++) {
      if (!front[face]) continue;
      let nearest = -Infinity;
      for (let k = 0; k < 4; k++) {
        const from = 3 * faces[4 * face + k];
        cornerX[k] = spots[from];
        cornerY[k] = spots[from + 1];
        nearest = Math.max(nearest, spots[from + 2]);
        // Edges are sharp bends of the surface, and the outline.
        const beyond = across[4 * face + k];
        if (beyond >= 0 && front[beyond]) continue;
        const to = 3 * faces[4 * face + ((k + 1) % 4)];
        fillLine(spots[from], spots[from + 1], spots[from + 2] + ratio,
          spots[to], spots[to + 1], spots[to + 2] + ratio, ratio, lineColor);
      }
      fillFace(cornerX, cornerY, spots[3 * faces[4 * face] + 2], slopes[2 * face], -slopes[2 * face + 1],
        nearest, shades[Math.round(LEVELS * light[face])]);
    }
  }
}

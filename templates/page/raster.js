// Rasteriser with a depth buffer, so that solids may touch and intersect. It draws on a canvas of its
// own, the sheet, which is then copied to the picture.

const SAMPLES = 2; // pixels of the sheet for each CSS pixel, along and across, to smooth what is drawn
const MOST_PIXELS = 4e6;

const raster = { sheet: document.createElement("canvas"), width: 0, height: 0, ratio: 1 };
raster.pen = raster.sheet.getContext("2d");

// Clear the sheet for a picture of a size in CSS pixels; `ratio` is device pixels per CSS pixel.
function startRaster(width, height) {
  const wanted = Math.max(SAMPLES, window.devicePixelRatio || 1);
  raster.ratio = Math.max(1, Math.min(wanted, Math.sqrt(MOST_PIXELS / (width * height))));
  const [across, down] = [width, height].map((size) => Math.max(1, Math.round(size * raster.ratio)));
  if (across !== raster.width || down !== raster.height) {
    Object.assign(raster, { width: across, height: down });
    Object.assign(raster.sheet, { width: across, height: down });
    raster.image = raster.pen.createImageData(across, down);
    raster.pixels = new Uint32Array(raster.image.data.buffer);
    raster.nearness = new Float32Array(across * down);
  }
  raster.pixels.fill(0);
  raster.nearness.fill(-Infinity);
}

function layRaster(width, height) {
  raster.pen.putImageData(raster.image, 0, 0);
  pen.imageSmoothingQuality = "high";
  pen.drawImage(raster.sheet, 0, 0, width, height);
}

// A colour as the sheet stores it, red in the lowest byte.
const packed = (red, green, blue) => ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;

// Fill a convex planar face with corners x, y, in pixels of the sheet, where it is the nearest. `near`
// is the depth value of its first corner, larger is nearer, `right` and `down` are its increments per
// pixel. `nearest` bounds it: for a face seen edge-on, a pixel's centre may lie far outside the face.
function fillFace(x, y, near, right, down, nearest, color) {
  const { width, height, pixels, nearness } = raster;
  const count = x.length;
  let top = Infinity;
  let bottom = -Infinity;
  for (let k = 0; k < count; k++) {
    top = Math.min(top, y[k]);
    bottom = Math.max(bottom, y[k]);
  }
  const last = Math.min(height, Math.ceil(bottom - 0.5));
  for (let row = Math.max(0, Math.ceil(top - 0.5)); row < last; row++) {
    const middle = row + 0.5;
    let from = Infinity;
    let to = -Infinity;
    for (let k = 0; k < count; k++) {
      const next = k + 1 < count ? k + 1 : 0;
      if (y[k] <= middle === y[next] <= middle) continue;
      const crossing = x[k] + ((middle - y[k]) * (x[next] - x[k])) / (y[next] - y[k]);
      from = Math.min(from, crossing);
      to = Math.max(to, crossing);
    }
    const first = Math.max(0, Math.ceil(from - 0.5));
    const end = Math.min(width, Math.ceil(to - 0.5));
    let here = near + right * (first + 0.5 - x[0]) + down * (middle - y[0]);
    for (let i = row * width + first; i < row * width + end; i++) {
      const limited = here < nearest ? here : nearest;
      if (limited > nearness[i]) {
        nearness[i] = limited;
        pixels[i] = color;
      }
      here += right;
    }
  }
}

// A line `thick` pixels wide between two points [x, y, nearness].
const lineX = new Float64Array(4);
const lineY = new Float64Array(4);
function fillLine(x0, y0, near0, x1, y1, near1, thick, color) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < 1e-6) return;
  const alongX = ((x1 - x0) / length) * (thick / 2);
  const alongY = ((y1 - y0) / length) * (thick / 2);
  // Extend both ends slightly, so that lines that meet leave no gap.
  lineX[0] = x0 - alongX / 2 + alongY;
  lineY[0] = y0 - alongY / 2 - alongX;
  lineX[1] = x1 + alongX / 2 + alongY;
  lineY[1] = y1 + alongY / 2 - alongX;
  lineX[2] = x1 + alongX / 2 - alongY;
  lineY[2] = y1 + alongY / 2 + alongX;
  lineX[3] = x0 - alongX / 2 - alongY;
  lineY[3] = y0 - alongY / 2 + alongX;
  const slope = (near1 - near0) / (length * length);
  fillFace(lineX, lineY, near0, slope * (x1 - x0), slope * (y1 - y0), Math.max(near0, near1), color);
}

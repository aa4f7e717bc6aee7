// `lines`: lines of a constant width on the screen. Each segment is a rectangle between two points
// that the graphics card widens, so that a line needs no new points when the view turns or zooms.

const lines = (() => {
  const VERTEX = `
    attribute vec3 start;
    attribute vec3 end;
    attribute vec2 corner;
    uniform float width;
    uniform vec2 size;
    uniform float near;
    void main() {
      mat4 toClip = projectionMatrix * modelViewMatrix;
      vec4 a = toClip * vec4(start, 1.0);
      vec4 b = toClip * vec4(end, 1.0);
      vec2 along = (b.xy - a.xy) * size;
      float length = length(along);
      along = length > 0.0 ? along / length : vec2(1.0, 0.0);
      vec2 across = vec2(-along.y, along.x);
      gl_Position = mix(a, b, corner.x);
      // The ends reach a little beyond the points, which closes the corners between segments.
      gl_Position.xy += (across * corner.y + along * (0.6 * corner.x - 0.3)) * width / size;
      gl_Position.z -= near;
    }`;
  const FRAGMENT = `
    uniform vec3 color;
    void main() {
      gl_FragColor = vec4(color, 1.0);
      #include <colorspace_fragment>
    }`;
  // The corners of a segment: which end, and which side. Vertices are not shared and not instanced,
  // since software in place of a graphics card draws each instance by itself.
  const CORNERS = [[0, -1], [0, 1], [1, 1], [1, -1]];
  const [FACES, STRIDE] = [[0, 2, 1, 0, 3, 2], 8];
  const size = { value: new THREE.Vector2(1, 1) };

  // Lines of `width` pixels and a color. With `pieces`, points are pairs of ends; else they are joined.
  function make({ color, width = 2, pieces = false, near = 0 }) {
    const geometry = new THREE.BufferGeometry();
    const material = new THREE.ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: { width: { value: width }, size, near: { value: near }, color: { value: new THREE.Color(color) } },
      side: THREE.DoubleSide,
      depthTest: tools.space,
    });
    const line = new THREE.Mesh(geometry, material);
    line.frustumCulled = false;
    line.matrixAutoUpdate = false;
    line.raycast = () => {};
    let [room, buffer] = [0, null]; // for so many segments

    function reserve(segments) {
      if (segments <= room) return;
      room = segments;
      geometry.dispose();
      buffer = new THREE.InterleavedBuffer(new Float32Array(4 * STRIDE * room), STRIDE);
      buffer.setUsage(THREE.DynamicDrawUsage);
      const index = new Uint32Array(6 * room);
      for (let i = 0; i < room; i += 1) {
        FACES.forEach((vertex, k) => (index[6 * i + k] = 4 * i + vertex));
        CORNERS.forEach((corner, k) => buffer.array.set(corner, (4 * i + k) * STRIDE + 6));
      }
      geometry.setIndex(new THREE.BufferAttribute(index, 1));
      [["start", 3, 0], ["end", 3, 3], ["corner", 2, 6]].forEach(([name, count, offset]) =>
        geometry.setAttribute(name, new THREE.InterleavedBufferAttribute(buffer, count, offset)));
    }

    // Write the segment number `i` between the points at two places of an array.
    function put(i, points, from, to) {
      const { array } = buffer;
      for (let vertex = 4 * i * STRIDE; vertex < 4 * (i + 1) * STRIDE; vertex += STRIDE) {
        for (let k = 0; k < 3; k += 1) {
          array[vertex + k] = points[from + k];
          array[vertex + 3 + k] = points[to + k];
        }
      }
    }

    // All points, x, y, z one after another.
    line.setPoints = (points) => {
      const segments = pieces ? Math.floor(points.length / 6) : points.length / 3 - 1;
      reserve(segments);
      for (let i = 0; i < segments; i += 1) put(i, points, (pieces ? 6 : 3) * i, (pieces ? 6 : 3) * i + 3);
      buffer.needsUpdate = true;
      line.setCount(segments);
      return line;
    };
    // One more segment, the one with number `i` of at most `most`.
    line.extend = (i, most, from, to) => {
      reserve(most);
      put(i, [...from, ...to], 0, 3);
      buffer.addUpdateRange(4 * STRIDE * i, 4 * STRIDE);
      buffer.needsUpdate = true;
    };
    // Forget the first segments.
    line.drop = (segments) => {
      buffer.array.copyWithin(0, 4 * STRIDE * segments);
      buffer.clearUpdateRanges();
      buffer.needsUpdate = true;
    };
    line.setCount = (segments) => geometry.setDrawRange(0, 6 * Math.max(0, segments));
    line.setColor = (name) => material.uniforms.color.value.set(name);
    return line;
  }

  // Joined points as pairs of ends with gaps between them.
  function dashes(points) {
    const found = [];
    for (let i = 0; i + 5 < points.length; i += 6) found.push(...points.slice(i, i + 6));
    return found;
  }

  // Joined points as pairs of ends.
  function pairs(points) {
    const found = [];
    for (let i = 0; i + 5 < points.length; i += 3) found.push(...points.slice(i, i + 6));
    return found;
  }

  return { make, dashes, pairs, setSize: (width, height) => size.value.set(width, height) };
})();

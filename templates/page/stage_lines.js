// `lines`: lines of a constant width on the screen. Each segment is a rectangle between two points
// that the graphics card widens, so that a line needs no new points when the view turns or zooms.

const lines = (() => {
  const VERTEX = `
    attribute vec3 start;
    attribute vec3 end;
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
      gl_Position = mix(a, b, position.x);
      // The ends reach a little beyond the points, which closes the corners between segments.
      gl_Position.xy += (across * position.y + along * (0.6 * position.x - 0.3)) * width / size;
      gl_Position.z -= near;
    }`;
  const FRAGMENT = `
    uniform vec3 color;
    void main() {
      gl_FragColor = vec4(color, 1.0);
      #include <colorspace_fragment>
    }`;
  const CORNERS = new Float32Array([0, -1, 0, 1, -1, 0, 1, 1, 0, 0, 1, 0]);
  const size = { value: new THREE.Vector2(1, 1) };

  // Lines of `width` pixels and a color. With `pieces`, points are pairs of ends; else they are joined.
  function make({ color, width = 2, pieces = false, near = 0 }) {
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(CORNERS, 3));
    geometry.setIndex([0, 2, 1, 0, 3, 2]);
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
    const stride = pieces ? 6 : 3;
    let buffer = null;

    // Set the first `count` points; all of `points`, x, y, z one after another, if not given.
    line.setPoints = (points, count = points.length / 3) => {
      if (!buffer || buffer.array.length < points.length) {
        geometry.dispose();
        buffer = new THREE.InstancedInterleavedBuffer(Float32Array.from(points), stride);
        buffer.setUsage(THREE.DynamicDrawUsage);
        geometry.setAttribute("start", new THREE.InterleavedBufferAttribute(buffer, 3, 0));
        geometry.setAttribute("end", new THREE.InterleavedBufferAttribute(buffer, 3, 3));
      } else {
        buffer.array.set(points);
        buffer.needsUpdate = true;
      }
      geometry.instanceCount = Math.max(0, pieces ? Math.floor(count / 2) : count - 1);
      return line;
    };
    line.setColor = (name) => material.uniforms.color.value.set(name);
    return line;
  }

  // Points of an arc about z, from one angle to another, x, y, z one after another.
  function arc(from, to, count = 48, radius = 1) {
    const points = [];
    for (let i = 0; i <= count; i += 1) {
      const angle = from + ((to - from) * i) / count;
      points.push(radius * Math.cos(angle), radius * Math.sin(angle), 0);
    }
    return points;
  }

  // The same as pairs of ends with gaps between them.
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

  return { make, arc, dashes, pairs, setSize: (width, height) => size.value.set(width, height) };
})();

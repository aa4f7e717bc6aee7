// `makeReplay`: the recorded run, and the state at any time of it. Between two rows the state is a
// cubic through both with the slopes that the mechanism computes there.

const makeReplay = (mechanism) => {
  const { run } = DATA;
  if (!run) return null;
  const t = new Float64Array(tools.bytes(run.t));
  const y = run.single ? Float64Array.from(new Float32Array(tools.bytes(run.y))) : new Float64Array(tools.bytes(run.y));
  const ny = DATA.states.length;
  const last = t.length - 1;
  const p = Float64Array.from(DATA.parameters, (x) => x.value);
  const u = Float64Array.from(DATA.inputs, (x) => x.value);
  const row = (i) => y.subarray(i * ny, (i + 1) * ny);
  const state = new Float64Array(ny);
  const slopes = [new Float64Array(ny), new Float64Array(ny)];
  const replay = { t, y, p, u, begin: t[0], end: t[last], rows: t.length, row, stateAt, neighbour, held: null };
  replay.heldAt = (time) => Boolean(replay.held?.[rowBefore(time)]);

  // The last row at or before a time, but not the last of all.
  function rowBefore(time) {
    let [low, high] = [0, last];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (t[middle] <= time) low = middle;
      else high = middle;
    }
    return low;
  }

  // The slopes at both ends of an interval, or null where they are of no use.
  function slopesOf(i) {
    if (!run.smooth || !mechanism.derivative) return null;
    if (replay.held?.[i] || replay.held?.[i + 1]) return null; // the derivative leaves out what holds it
    try {
      slopes.forEach((slope, k) => slope.set(mechanism.derivative(t[i + k], row(i + k), p, u)));
    } catch {
      return null;
    }
    return slopes.every((slope) => slope.every(Number.isFinite)) ? slopes : null;
  }

  // The state at a time; the next call uses the same array.
  function stateAt(time) {
    const i = rowBefore(time);
    const h = t[Math.min(i + 1, last)] - t[i];
    const s = h > 0 ? Math.min(Math.max((time - t[i]) / h, 0), 1) : Number(time >= t[i]);
    const [from, to] = [row(i), row(Math.min(i + 1, last))];
    const slope = s > 0 && s < 1 ? slopesOf(i) : null;
    for (let k = 0; k < ny; k += 1) {
      const line = from[k] + s * (to[k] - from[k]);
      if (!slope) {
        state[k] = line;
        continue;
      }
      // How much a cubic with these slopes differs from the line.
      const [a, b] = [h * slope[0][k] - (to[k] - from[k]), h * slope[1][k] - (to[k] - from[k])];
      const bend = s * (1 - s) * (a * (1 - s) - b * s);
      state[k] = line + bend;
    }
    for (const four of DATA.quaternions ?? []) {
      const length = Math.hypot(...four.map((k) => state[k])) || 1;
      for (const k of four) state[k] /= length; // interpolation changes the length of a quaternion
    }
    return state;
  }

  // The time of the next row in a direction; several rows have the same time at an impact.
  function neighbour(time, direction) {
    if (direction > 0) return t.find((other) => other > time) ?? t[last];
    return t.findLast((other) => other < time) ?? t[0];
  }

  return replay;
};

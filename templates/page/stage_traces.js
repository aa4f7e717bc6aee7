// `makeTraces`: the paths of chosen points. Those of a run are computed once, and only as much of
// them is drawn as has passed; those of a live motion grow.

const makeTraces = (scene, paper) => {
  const { place, vector } = tools;
  const { traces, bodies } = DATA.drawing;
  const MOST = 4000; // segments of a live path; the oldest make way
  const LAYER = -10;
  const paths = traces.map((trace) => {
    const line = lines.make({ color: "#888888", width: 1.6 });
    line.renderOrder = LAYER;
    line.visible = false;
    scene.add(line);
    return { trace, line, count: 0, last: null }; // segments of the live path, and its last point
  });
  let [times, whole] = [null, null]; // of a run: the time of each point

  const spot = ({ trace }, poses, geometry) => place(poses, trace.body, vector(trace.at, geometry));

  return {
    paint: () => paths.forEach(({ trace, line }) => {
      const color = new THREE.Color(bodies[trace.body]?.color ?? "#888888");
      line.setColor(color.lerp(paper(), 0.35));
    }),
    // The paths of a run, from the poses at its times.
    load(given, posesAt) {
      times = given;
      whole = paths.map(() => new Float32Array(3 * times.length));
      for (let i = 0; i < times.length; i += 1) {
        const { poses, geometry } = posesAt(i);
        paths.forEach((path, k) => whole[k].set(spot(path, poses, geometry), 3 * i));
      }
      paths.forEach((path, k) => path.line.setPoints(whole[k]));
    },
    clear() {
      times = null;
      for (const path of paths) Object.assign(path, { count: 0, last: null });
    },
    // One more point of a live motion.
    append(poses, geometry) {
      for (const path of paths) {
        const point = spot(path, poses, geometry);
        if (path.last) {
          if (path.count === MOST) {
            path.line.drop(MOST / 4);
            path.count -= MOST / 4;
          }
          path.line.extend(path.count, MOST, path.last, point);
          path.count += 1;
        }
        path.last = point;
      }
    },
    // The paths up to a time of a run, or as far as a live motion came.
    draw(show, t) {
      let count = 0;
      if (times) while (count < times.length && times[count] <= t) count += 1;
      for (const path of paths) {
        const segments = times ? count - 1 : path.count;
        path.line.visible = show.traces && segments > 0;
        if (path.line.visible) path.line.setCount(segments);
      }
    },
  };
};

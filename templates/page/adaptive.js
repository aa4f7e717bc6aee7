// `adaptive`: methods that choose steps of their own between the ends of the page's steps, so that the
// error of each is below a tolerance. As in `methods`, `change(problem, t, y, h)` returns y(t + h) - y(t).

const adaptive = (() => {
  const [RTOL, ATOL] = [1e-9, 1e-12];
  const [SAFETY, SMALLEST, GREATEST] = [0.9, 0.2, 10];
  const MOST = 100000; // steps within one of the page's

  // Dormand and Prince, order 8 (DOP853): Hairer, Norsett, Wanner, Solving ODEs I, table II.5.4. Each sum
  // over slopes as pairs of a slope's number and its factor: those of the stages, of the change, and of
  // the errors of order 5 and 3. Steps are chosen as by `eomgen.run.integrators.dormand_prince_8`.
  const NODES = [
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333,
    0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
  ];
  const SUMS = [
    [],
    [[0, 0.05260015195876773]],
    [[0, 0.0197250569845379], [1, 0.0591751709536137]],
    [[0, 0.02958758547680685], [2, 0.08876275643042054]],
    [[0, 0.2413651341592667], [2, -0.8845494793282861], [3, 0.924834003261792]],
    [[0, 0.037037037037037035], [3, 0.17082860872947386], [4, 0.12546768756682242]],
    [[0, 0.037109375], [3, 0.17025221101954405], [4, 0.06021653898045596], [5, -0.017578125]],
    [[0, 0.03709200011850479], [3, 0.17038392571223998], [4, 0.10726203044637328], [5, -0.015319437748624402],
      [6, 0.008273789163814023]],
    [[0, 0.6241109587160757], [3, -3.3608926294469414], [4, -0.868219346841726], [5, 27.59209969944671],
      [6, 20.154067550477894], [7, -43.48988418106996]],
    [[0, 0.47766253643826434], [3, -2.4881146199716677], [4, -0.590290826836843], [5, 21.230051448181193],
      [6, 15.279233632882423], [7, -33.28821096898486], [8, -0.020331201708508627]],
    [[0, -0.9371424300859873], [3, 5.186372428844064], [4, 1.0914373489967295], [5, -8.149787010746927],
      [6, -18.52006565999696], [7, 22.739487099350505], [8, 2.4936055526796523], [9, -3.0467644718982196]],
    [[0, 2.273310147516538], [3, -10.53449546673725], [4, -2.0008720582248625], [5, -17.9589318631188],
      [6, 27.94888452941996], [7, -2.8589982771350235], [8, -8.87285693353063], [9, 12.360567175794303],
      [10, 0.6433927460157636]],
    [[0, 0.054293734116568765], [5, 4.450312892752409], [6, 1.8915178993145003], [7, -5.801203960010585],
      [8, 0.3111643669578199], [9, -0.1521609496625161], [10, 0.20136540080403034], [11, 0.04471061572777259]],
    [[0, 0.01312004499419488], [5, -1.2251564463762044], [6, -0.4957589496572502], [7, 1.6643771824549864],
      [8, -0.35032884874997366], [9, 0.3341791187130175], [10, 0.08192320648511571],
      [11, -0.022355307863886294]],
    [[0, -0.18980075407240762], [5, 4.450312892752409], [6, 1.8915178993145003], [7, -5.801203960010585],
      [8, -0.4226823213237919], [9, -0.1521609496625161], [10, 0.20136540080403034], [11, 0.02265179219836082]],
  ];

  const eighthRoot = (x) => Math.sqrt(Math.sqrt(Math.sqrt(x)));
  const dormandPrince = (ny) => {
    const slopes = NODES.map(() => new Float64Array(ny));
    const [state, here, last] = [0, 0, 0].map(() => new Float64Array(ny));
    const change = new Float64Array(ny);
    let length = Infinity;
    const sum = (row, k) => {
      let total = 0;
      for (let j = 0; j < row.length; j += 1) total += row[j][1] * slopes[row[j][0]][k];
      return total;
    };
    // The error of a step of length h from `here` to `last`, relative to the tolerance.
    const errorOf = (h) => {
      let [long, short] = [0, 0];
      for (let k = 0; k < ny; k += 1) {
        const scale = ATOL + Math.max(Math.abs(here[k]), Math.abs(last[k])) * RTOL;
        long += (sum(SUMS[13], k) / scale) ** 2;
        short += (sum(SUMS[14], k) / scale) ** 2;
      }
      const size = Math.sqrt((long + 0.01 * short) * ny);
      return size > 0 ? h * long / size : size;
    };
    return (problem, t, y, whole) => {
      here.set(y);
      change.fill(0);
      let done = 0;
      slopes[0].set(problem.f(t, y));
      if (!Number.isFinite(length)) length = Math.min(whole, 1e-4);
      for (let count = 0; done < whole; count += 1) {
        const rest = whole - done;
        const h = Math.min(length, rest);
        if (count === MOST || !(h > 1e-15 * Math.max(1, Math.abs(t)))) {
          throw new Error("the steps become too small: the motion is not smooth here");
        }
        for (let i = 1; i < 12; i += 1) {
          for (let k = 0; k < ny; k += 1) state[k] = here[k] + h * sum(SUMS[i], k);
          slopes[i].set(problem.f(t + done + NODES[i] * h, state));
        }
        for (let k = 0; k < ny; k += 1) last[k] = here[k] + h * sum(SUMS[12], k);
        const error = errorOf(h);
        if (!(error < 1)) {
          length = h * (error >= 1 ? Math.max(SMALLEST, SAFETY / eighthRoot(error)) : SMALLEST);
          continue;
        }
        const factor = error === 0 ? GREATEST : Math.min(GREATEST, SAFETY / eighthRoot(error));
        length = h === rest && h < length ? Math.max(length, h * factor) : h * factor;
        for (let k = 0; k < ny; k += 1) change[k] += h * sum(SUMS[12], k);
        for (let k = 0; k < ny; k += 1) here[k] = y[k] + change[k];
        done = h === rest ? whole : done + h;
        if (done < whole) slopes[0].set(problem.f(t + done, here));
      }
      return change;
    };
  };

  return [{ name: "DOP853", about: "Dormand-Prince 8(5,3), steps by tolerance", make: dormandPrince }];
})();

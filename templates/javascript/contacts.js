// Rigid contacts: what the engine is given of them, and of the steps in which they close and open.

// A mechanism's contacts: of its states gaps(t, y) and rates(t, y), which are in `sizes`, held(t, y, forces), and
// impact(t, y, chosen). One that is not active(c) has no effect.
const contactLaw = ({ states, sizes, active, gaps, rates, held, impact }) => ({
  gaps(t, y, out) {
    gaps(t, y).forEach((x, c) => (out[c] = active(c) ? x / sizes[c] : Infinity));
  },
  rates(t, y, out) {
    rates(t, y).forEach((x, c) => (out[c] = active(c) ? x / sizes[c] : 0));
  },
  held(t, y, forces, out) {
    out.set(held(t, y, forces));
    sizes.forEach((size, c) => (out[states + c] /= size));
  },
  impact(t, y, contact, bounce, out) {
    const chosen = [...sizes.map(() => 0), bounce];
    chosen[contact] = 1;
    out.set(impact(t, y, chosen));
  },
});

// Steps between events: change(t, y, h) is what one of h adds to the state, or null; dense(t, y, end) gives the state, or null
// if it is the sum of these; placed(t, y) puts a state where it belongs, false if that is not possible; `added` adds in two
// parts, of which `lost` is what rounding took.
const contactWay = ({ states, change, dense, placed, added }) => {
  const [last, lost] = [new Float64Array(states), new Float64Array(states)];
  let [start, first, until] = [0, last, 0];
  const isFinite = (y) => y.every(Number.isFinite);
  return {
    last,
    // A step of h from t and y to `last` at `end`; false if there is none.
    go(t, y, h, end) {
      [start, first, until] = [t, y.slice(), end];
      const found = dense(t, first, end);
      last.set(found ?? first);
      if (found) return isFinite(last);
      const step = change(t, first.slice(), h);
      if (!step) return false;
      added({ value: last, lost }, step);
      return placed(end, last) && isFinite(last);
    },
    // Sums begin anew.
    part: () => lost.fill(0),
    // The state some seconds after the start of the step: if it is not dense that after a shorter one.
    state(s, out) {
      const [end, whole] = [start + s, s >= until - start];
      if (whole || s <= 0 || end <= start) {
        out.set(whole ? last : first);
        return;
      }
      const found = dense(start, first, end);
      const step = found ? null : change(start, first.slice(), end - start);
      const there = found ?? first.map((x, i) => (step ? x + step[i] : NaN));
      out.set(found || placed(end, there) ? there : there.fill(NaN));
    },
  };
};

// `makeSamples` keeps the states of a run, known whole or arriving one by one, and computes the
// values of channels from them when they are asked for.
//   span     seconds that are kept, counted back from the last sample
//   spacing  seconds between samples; those that come sooner are left out
//   most     numbers that are kept, of all states together
// Samples are counted from the start of the run; `first` and `end` bound those that are kept.

const makeSamples = (channels, { span = Infinity, spacing = 0, most = 2 ** 23 } = {}) => {
  const samples = { span, spacing, first: 0, end: 0, full: false };
  let capacity = 0;
  let offset = 0; // number of the sample at index 0 of the arrays
  let width = 0;
  let [times, states] = [new Float64Array(0), new Float64Array(0)];
  // How much coarser than the rounding of doubles values are, and changes, which are small differences
  // that are asked for because they are small.
  const [DOUBLE, SINGLE] = [{ value: 1, change: 1e-3 }, { value: 1e5, change: 1e6 }];
  let [given, start, precision] = [[], null, DOUBLE];
  const columns = new Map();
  const sizes = new Map(); // greatest absolute values, by family and unit

  const sizeKey = (channel) => `${channel.family} ${channel.unit}`;
  const at = (number) => number - offset;
  const same = (a, b) => a === b || (a.length === b.length && a.every((x, k) => x === b[k]));
  const copy = (values) => Float64Array.from(values ?? []);

  samples.clear = () => {
    Object.assign(samples, { first: 0, end: 0, full: false });
    [capacity, offset, width] = [0, 0, 0];
    [times, states] = [new Float64Array(0), new Float64Array(0)];
    [given, start, precision] = [[], null, DOUBLE];
    columns.clear();
    sizes.clear();
  };

  // A run that is known whole: t (n), y (n ny). `held` says for each sample whether a contact is held;
  // without it one may be wherever there are contacts. `single`: y was rounded to 24 bits.
  samples.set = (t, y, p = [], u = [], held = null, single = false) => {
    samples.clear();
    precision = single ? SINGLE : DOUBLE;
    width = t.length ? y.length / t.length : 0;
    [times, states, capacity] = [t, y, t.length];
    const values = [false, true].map((known) => ({ p: copy(p), u: copy(u), held: known }));
    given = Array.from(t, (_, i) => values[(held ? held[i] : channels.mayHold) ? 1 : 0]);
    samples.end = t.length;
    if (t.length) start = rowOf(0);
  };

  // Room for one more sample: move the kept ones to the front, or take twice the room.
  function makeRoom() {
    const kept = samples.end - samples.first;
    const from = at(samples.first);
    if (from <= capacity / 2) capacity = Math.max(256, 2 * capacity);
    const moved = (values, per) => {
      const larger = new Float64Array(capacity * per);
      larger.set(values.subarray(from * per, (from + kept) * per));
      return larger;
    };
    times = moved(times, 1);
    states = moved(states, width);
    given = given.slice(from, from + kept);
    for (const column of columns.values()) column.values = moved(column.values, 1);
    offset = samples.first;
  }

  // What belongs to a sample beside its state; samples that follow one another share what is equal.
  function shared(before, p, u, held) {
    if (!before) return { p: copy(p), u: copy(u), held };
    const [equalP, equalU] = [same(before.p, p), same(before.u, u)];
    if (equalP && equalU && before.held === held) return before;
    return { p: equalP ? before.p : copy(p), u: equalU ? before.u : copy(u), held };
  }

  // One more sample of a live run; whether it is kept. An earlier time begins a new run.
  samples.append = (t, y, p = [], u = [], held = channels.mayHold) => {
    if (samples.end > samples.first) {
      const last = times[at(samples.end - 1)];
      if (t < last) samples.clear();
      else if (t - last < samples.spacing * (1 - 1e-9)) return false;
    }
    if (samples.full) return false;
    width = y.length;
    if (at(samples.end) >= capacity) makeRoom();
    const index = at(samples.end);
    times[index] = t;
    states.set(y, index * width);
    given[index] = shared(given[index - 1], p, u, held);
    samples.end += 1;
    if (!start) start = { ...rowOf(index), y: copy(y) };
    while (samples.first < samples.end - 1 && times[at(samples.first)] < t - samples.span) samples.first += 1;
    if ((samples.end - samples.first) * (width + 1) > most) {
      if (samples.span === Infinity) samples.full = true;
      else samples.first += 1;
    }
    return true;
  };

  const rowOf = (index) => ({
    t: times[index],
    y: states.subarray(index * width, (index + 1) * width),
    ...given[index],
  });

  function results(family, row) {
    if (row.held && channels.unknownWhileHeld.has(family)) return null;
    try {
      return channels.families[family](row);
    } catch {
      return null; // where the mechanism has no value
    }
  }

  function startValue(channel) {
    const values = start && channel.change ? results(channel.family, start) : null;
    return values ? channel.of(values) : 0;
  }

  // Compute what is missing in the columns of channels of one family.
  function fill(family, wanted) {
    const open = wanted.map((channel) => {
      if (!columns.has(channel.key)) {
        columns.set(channel.key, { values: new Float64Array(capacity), done: samples.first, from: startValue(channel) });
      }
      return { channel, column: columns.get(channel.key) };
    });
    for (const { column } of open) column.done = Math.max(column.done, samples.first);
    const kinds = new Map(wanted.map((channel) => [sizeKey(channel), channel.kin]));
    const begin = Math.min(...open.map(({ column }) => column.done));
    for (let number = begin; number < samples.end; number += 1) {
      const index = at(number);
      const values = results(family, rowOf(index));
      for (const { channel, column } of open) {
        if (number < column.done) continue;
        column.values[index] = values ? channel.of(values) - column.from : NaN;
      }
      if (!values) continue;
      for (const [key, kin] of kinds) {
        let size = sizes.get(key) ?? 0;
        for (const k of kin) if (Math.abs(values[k]) > size) size = Math.abs(values[k]);
        sizes.set(key, size);
      }
    }
    for (const { column } of open) column.done = samples.end;
  }

  // The values of channels at the kept samples, one array for each.
  samples.columns = (keys) => {
    const wanted = keys.map((key) => channels.get(key));
    for (const family of new Set(wanted.map((c) => c.family))) {
      fill(family, [...new Set(wanted.filter((c) => c.family === family))]);
    }
    return keys.map((key) => columns.get(key).values.subarray(at(samples.first), at(samples.end)));
  };
  samples.times = () => times.subarray(at(samples.first), at(samples.end));

  // The size of a channel beside which `numbers` sees what is rounding: the greatest value so far of
  // all that is of its kind, more where values are less precise.
  samples.scale = (key) => {
    const channel = channels.get(key);
    const size = sizes.get(sizeKey(channel)) ?? 0;
    return size * (channel.change ? precision.change : precision.value);
  };

  // Forget columns of channels that are no longer shown.
  samples.keepOnly = (keys) => {
    for (const key of columns.keys()) if (!keys.has(key)) columns.delete(key);
  };

  // Index, among the kept samples, of the last one that is not after `time`.
  samples.before = (time) => {
    const t = samples.times();
    let [low, high] = [0, t.length - 1];
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (t[middle] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  };

  // Value of a column at any time, linear between samples.
  samples.valueAt = (values, time) => {
    const t = samples.times();
    if (!t.length) return NaN;
    const low = samples.before(time);
    if (low + 1 >= t.length || time <= t[low]) return values[low];
    const part = (time - t[low]) / (t[low + 1] - t[low]);
    return values[low] + part * (values[low + 1] - values[low]);
  };

  // Columns at other times, which ascend: linear between samples, nan before the first and after the last.
  samples.columnsAt = (keys, wanted) => {
    const t = samples.times();
    return samples.columns(keys).map((values) => {
      let low = 0;
      return Float64Array.from(wanted, (time) => {
        while (low + 1 < t.length && t[low + 1] <= time) low += 1;
        if (!(time >= t[0]) || (low + 1 === t.length && time > t[low])) return NaN;
        const part = low + 1 < t.length ? (time - t[low]) / (t[low + 1] - t[low]) : 0;
        return part > 0 ? values[low] + part * (values[low + 1] - values[low]) : values[low];
      });
    });
  };

  // The kept sample next to a time, as copies {t, y, p, u, held}; null if there is none.
  samples.rowAt = (time) => {
    const t = samples.times();
    if (!t.length) return null;
    const low = samples.before(time);
    const nearest = low + 1 < t.length && t[low + 1] - time < time - t[low] ? low + 1 : low;
    const row = rowOf(at(samples.first) + nearest);
    return { ...row, y: copy(row.y), p: copy(row.p), u: copy(row.u) };
  };

  return samples;
};

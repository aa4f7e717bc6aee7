// `makeRecorder` keeps every step of a live run, and writes tables as `eomgen simulate` does: a line
// of names, then for each step its time, its states, and the channels that are asked for.

const makeRecorder = (data, channels, { megabytes = 64 } = {}) => {
  const samples = makeSamples(channels, { most: megabytes * 131072 });
  const recorder = { recording: false, samples, onChange: null };
  const INTERVAL = 200; // ms between calls of onChange while it records
  let reported = 0;
  function report() {
    reported = performance.now();
    recorder.onChange?.(recorder);
  }

  Object.defineProperties(recorder, {
    rows: { get: () => samples.end },
    seconds: { get: () => (samples.end ? samples.times()[samples.end - 1] - samples.times()[0] : 0) },
    full: { get: () => samples.full },
  });

  // Forget what was recorded, and record from now on.
  recorder.start = () => {
    samples.clear();
    recorder.recording = true;
    report();
  };
  recorder.stop = () => {
    recorder.recording = false;
    report();
  };

  // One step. A run that begins again, or a full memory, ends the record.
  recorder.append = (t, y, p, u, held) => {
    if (!recorder.recording) return;
    const began = samples.end && t < samples.times()[samples.end - 1];
    if (!began) samples.append(t, y, p, u, held);
    if (began || samples.full) recorder.stop();
    else if (performance.now() - reported > INTERVAL) report();
  };

  const columnName = (key) => (channels.states.includes(key) ? key : key.replaceAll(".", "_"));
  const named = (of, keys) => of.columns(keys).map((values, k) => ({ name: columnName(keys[k]), values }));

  // The table of samples: the states, then other channels.
  recorder.table = (of = samples, keys = []) => {
    const more = keys.filter((key) => !channels.states.includes(key));
    return downloads.table(of.times(), named(of, [...channels.states, ...more]));
  };
  recorder.download = (of = samples, keys = []) => {
    if (!of.times().length) return;
    downloads.saveText(`${downloads.fileName(data.name)}.csv`, recorder.table(of, keys));
  };

  return recorder;
};

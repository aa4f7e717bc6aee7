// `makePlotting`: connects the plots and the recorder with the run that is replayed or with the live
// motion. The plots' cursor moves the picture, and the picture the cursor.

const makePlotting = ({ mechanism, replay, seek, put }) => {
  const { byId, element } = tools;
  const channels = makeChannels(DATA, mechanism);
  const plots = makePlots(byId("plots"), channels, { onSeek: seek, onPut: put, name: DATA.name });
  const recorder = makeRecorder(DATA, channels);
  if (replay && channels.mayHold) replay.held = channels.heldAt(replay.t, DATA.run.events);
  byId("plots-panel").hidden = false;
  plots.show(plots.first());
  byId("plots-panel").addEventListener("toggle", () => plots.refresh());

  // ---- Recording ----

  const record = element("button", { type: "button", id: "record", "aria-pressed": "false", title: "Record the live motion" }, "Record");
  const save = element("button", { type: "button", id: "save-csv", title: "Download as CSV" }, "CSV");
  byId("recording").append(record, save);
  record.addEventListener("click", () => (recorder.recording ? recorder.stop() : recorder.start()));
  save.addEventListener("click", () => (recorder.rows ? recorder.download() : recorder.download(plots.samples, plots.keys())));
  recorder.onChange = () => {
    record.setAttribute("aria-pressed", String(recorder.recording));
    record.textContent = recorder.recording ? `Stop, ${recorder.seconds.toFixed(1)} s` : "Record";
    save.title = recorder.rows ? "Download the record as CSV" : "Download what is plotted as CSV";
  };

  return {
    // What the plots show from now on.
    source(mode) {
      if (mode === "live") plots.live();
      else plots.setSource(replay.t, replay.y, replay.p, replay.u, replay.held ?? undefined, DATA.run.single);
    },
    append({ t, y, p, u, events }) {
      const held = channels.heldAfter(events);
      plots.append(t, y, p, u, held);
      recorder.append(t, y, p, u, held);
    },
    cursor: (t) => plots.cursor(t),
    restart: () => plots.live(),
    compare: (samples) => plots.compare(samples),
    // Plots of what is known here, as `plots.specs` told them.
    restore: (specs) => plots.show(specs
      .filter(({ x }) => x === null || channels.get(x))
      .map(({ x, y }) => ({ x, y: y.filter(channels.get) }))
      .filter(({ y }) => y.length)),
    repaint: () => plots.refresh(),
    rowAt: (t) => plots.rowAt(t),
    plots,
    channels,
    recorder,
  };
};

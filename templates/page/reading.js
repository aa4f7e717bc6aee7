// What tests and curious people may read of the page.
window.eomgen = Object.freeze({
  get mode() { return player.clock.mode; },
  get playing() { return player.clock.playing; },
  get time() { return player.current().t; },
  get state() { return Array.from(player.current().y); },
  get parameters() { return Array.from(player.current().p); },
  get inputs() { return Array.from(player.current().u); },
  get lit() { return player.show.lit ?? null; }, // the effect whose arrows and terms are marked
  get error() { return player.engine?.error ?? null; },
  get step() { return player.engine ? { method: player.engine.method, seconds: player.engine.dt, ms: player.engine.cost() } : null; },
  // The second run, which is kept beside, at the time that is shown.
  get kept() {
    const { engine, given } = player.comparison;
    return engine ? { method: engine.method, parameters: Array.from(engine.p), state: Array.from(given(player.current().t)[1]) } : null;
  },
  // World positions of the centres of mass, m, and where they are in the picture, CSS pixels.
  get centers() { return DATA.bodies.map((_, k) => tools.center(player.stage.poses(), k).slice(0, DATA.dimensions)); },
  get screen() { return DATA.bodies.map((_, k) => player.stage.toScreen(tools.center(player.stage.poses(), k))); },
  toScreen: (point) => player.stage.toScreen(point),
  pick: (x, y) => player.stage.pick(x, y),
  get view() { const { zoom, x, y, azimuth, elevation, height } = player.stage.view; return { zoom, x, y, azimuth, elevation, height }; },
  // Pictures a second over the last ones.
  get rate() {
    const { frames } = player.clock;
    return frames.length > 1 ? (1000 * (frames.length - 1)) / (frames[frames.length - 1] - frames[0]) : 0;
  },
  picture: player.stage.failed === "",
  goTo: (time) => player.goTo(time),
});

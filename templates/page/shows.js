// `makeShows`: what the picture shows beside bodies, by the boxes of the menu: {traces: true, forces: false, …}.

const makeShows = (mechanism, redraw) => {
  const { byId, element } = tools;
  const SHOWS = [
    ["traces", "Traces", true], ["joints", "Joints", true], ["centres", "Centres of mass", false],
    ["shadows", "Shadows", true], ["forces", "Forces of effects", false], ["torques", "Torques of effects", false],
    ["velocities", "Velocities", false], ["reactions", "Joint forces", false],
  ];
  // What this mechanism has nothing of is not offered.
  const offered = {
    shadows: Boolean(DATA.drawing.floor),
    forces: DATA.loads.length > 0,
    torques: DATA.loads.length > 0,
    velocities: Boolean(mechanism.bodyVelocities),
    reactions: Boolean(mechanism.jointForces),
  };
  const show = Object.fromEntries(SHOWS.map(([key, , on]) => [key, on]));
  for (const [key, text, on] of SHOWS) {
    if (offered[key] === false) continue;
    const box = element("input", { type: "checkbox", id: `show-${key}`, checked: on });
    box.addEventListener("change", () => {
      show[key] = box.checked;
      redraw();
    });
    byId("shows").append(element("label", {}, box, text));
  }
  return show;
};

// `listenToPrinting`: on paper, and in a PDF, picture and plots are vector graphics in place of canvases.

const listenToPrinting = (stage, plots) => {
  const { byId } = tools;
  let added = [];
  const put = (box, source) => {
    const drawing = new DOMParser().parseFromString(source, "image/svg+xml").documentElement;
    drawing.setAttribute("class", "on-paper");
    added.push(box.appendChild(document.importNode(drawing, true)));
  };
  window.addEventListener("beforeprint", () => {
    if (!stage.failed) put(byId("stage").parentElement, stage.toSvg());
    for (const { box, source } of plots.drawings()) put(box, source);
    document.body.classList.add("printed");
  });
  window.addEventListener("afterprint", () => {
    for (const element of added) element.remove();
    added = [];
    document.body.classList.remove("printed");
  });
};

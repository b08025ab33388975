(() => {
  const frames = JSON.parse(document.getElementById("frames").textContent);
  const slider = document.querySelector(".orbit");
  const image = document.getElementById("frame");
  const angle = document.getElementById("angle");
  // Decode everything once, so that dragging never waits.
  const kept = frames.map((uri) => Object.assign(new Image(), { src: uri }));
  let at = 0;
  const show = (index) => {
    at = ((index % frames.length) + frames.length) % frames.length;
    image.src = kept[at].src;
    const degrees = Math.round((360 * at) / frames.length);
    angle.textContent = `${degrees}°`;
    slider.setAttribute("aria-valuenow", at);
    slider.setAttribute("aria-valuetext", at === 0 ? "front view" : `turned by ${degrees} degrees`);
  };
  let start = null;
  slider.addEventListener("pointerdown", (event) => {
    start = { x: event.clientX, at };
    slider.setPointerCapture(event.pointerId);
  });
  slider.addEventListener("pointermove", (event) => {
    if (start === null) return;
    const turn = (event.clientX - start.x) / Math.max(slider.clientWidth, 1);
    show(start.at + Math.round(turn * frames.length));
  });
  for (const end of ["pointerup", "pointercancel"]) {
    slider.addEventListener(end, () => { start = null; });
  }
  const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 3, PageDown: -3 };
  slider.addEventListener("keydown", (event) => {
    const ends = { Home: 0, End: frames.length - 1 };
    if (event.key in steps) show(at + steps[event.key]);
    else if (event.key in ends) show(ends[event.key]);
    else return;
    event.preventDefault();
  });
})();

// Shows a participant the trials of their sheet and saves what they say to a file. Nothing leaves the page otherwise.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const stage = document.getElementById("stage");
  const answers = [];
  let participant = "";
  let expertise = "";
  let sheet = 0;

  const element = (name, attributes, ...children) => {
    const made = Object.assign(document.createElement(name), attributes);
    made.append(...children);
    return made;
  };

  // FNV-1a: the same name always falls on the same sheet.
  const sheetOf = (name) => {
    let hash = 0x811c9dc5;
    for (const byte of new TextEncoder().encode(name)) {
      hash = Math.imul(hash ^ byte, 0x01000193) >>> 0;
    }
    return hash % data.sheets.length;
  };

  const letter = (place) => String.fromCharCode(65 + place);

  function begin() {
    const name = element("input", { type: "text", id: "name", autocomplete: "off" });
    const go = element("button", { type: "submit", disabled: true }, "Begin");
    const groups = data.expertise.map(([key, words]) =>
      element("label", {}, element("input", { type: "radio", name: "expertise", value: key }), " " + words));
    const ready = () => {
      const chosen = form.querySelector("[name=expertise]:checked");
      go.disabled = !(name.value.trim() && chosen);
    };
    const form = element("form", { oninput: ready },
      element("p", {}, `You will see ${data.sheets[0].length} paintings, and for each what `
        + `${data.sheets[0][0].tokens.length} methods made of it in three dimensions. Turn them, and say which you prefer.`),
      element("p", {}, element("label", {}, "A name or code of your own: ", name)),
      element("fieldset", {}, element("legend", {}, "What do you do?"), ...groups),
      go);
    form.onsubmit = (event) => {
      event.preventDefault();
      participant = name.value.trim();
      expertise = form.querySelector("[name=expertise]:checked").value;
      sheet = sheetOf(participant);
      trial(0);
    };
    stage.replaceChildren(form);
  }

  function trial(number) {
    const trials = data.sheets[sheet];
    if (number === trials.length) {
      return finish();
    }
    const { trial: id, tokens } = trials[number];
    const turns = tokens.map((token) => data.pictures[token]);
    const angles = turns.flatMap((turn) => turn.angles);
    // A turn that leaves less than a quarter open goes round; any other ends on both sides.
    const span = Math.max(...angles) - Math.min(...angles);
    const closed = span >= 270;
    const [low, high] = closed ? [0, 359] : [Math.min(...angles), Math.max(...angles)];
    const within = (angle) => (closed ? ((angle % 360) + 360) % 360 : Math.min(high, Math.max(low, angle)));
    const apart = (a, b) => {
      const d = Math.abs(a - b) % 360;
      return closed ? Math.min(d, 360 - d) : Math.abs(a - b);
    };
    const images = turns.map((_, place) => element("img", {
      alt: `Picture ${letter(place)}, turned by the slider`, draggable: false,
    }));
    const slider = element("input", { type: "range", id: "turn", step: 1, min: low, max: high });
    slider.value = within(0);
    slider.setAttribute("aria-label", "Turn all pictures");
    const show = () => {
      const angle = Number(slider.value);
      images.forEach((image, place) => {
        const { angles: of, frames } = turns[place];
        const nearest = of.reduce((best, a, i) => (apart(a, angle) < apart(of[best], angle) ? i : best), 0);
        image.src = frames[nearest];
      });
    };
    slider.oninput = show;
    show();
    let dragged = null;
    images.forEach((image) => {
      image.onpointerdown = (event) => {
        dragged = { x: event.clientX, from: Number(slider.value) };
        image.setPointerCapture(event.pointerId);
      };
      image.onpointermove = (event) => {
        if (dragged) {
          // The front follows the hand.
          slider.value = within(dragged.from - (event.clientX - dragged.x) * 0.6);
          show();
        }
      };
      image.onpointerup = image.onpointercancel = () => { dragged = null; };
    });
    const next = element("button", { type: "submit", disabled: true }, number + 1 === trials.length ? "Finish" : "Next");
    const questions = data.questions.map(([key, words]) => {
      const choice = (value, text) =>
        element("label", {}, element("input", { type: "radio", name: key, value }), " " + text);
      return element("fieldset", {}, element("legend", {}, words),
        ...tokens.map((_, place) => choice(String(place), letter(place))), choice("none", "I cannot tell"));
    });
    const form = element("form", {}, ...questions, next);
    form.oninput = () => {
      next.disabled = data.questions.some(([key]) => !form.querySelector(`[name=${key}]:checked`));
    };
    form.onsubmit = (event) => {
      event.preventDefault();
      for (const [question] of data.questions) {
        const value = form.querySelector(`[name=${question}]:checked`).value;
        const place = value === "none" ? null : Number(value);
        answers.push({ trial: id, question, choice: place === null ? null : tokens[place], place });
      }
      trial(number + 1);
    };
    const figures = images.map((image, place) => element("figure", { className: "turns" }, image, element("figcaption", {}, letter(place))));
    if (data.paintings[id]) {
      figures.unshift(element("figure", { className: "painting" }, element("img", { src: data.paintings[id], alt: "The painting", draggable: false }),
        element("figcaption", {}, "The painting")));
    }
    stage.replaceChildren(
      element("progress", { max: trials.length, value: number }),
      element("div", { className: "row" }, ...figures),
      element("p", { className: "hint" }, "Drag a picture sideways, or use the slider or the arrow keys; all turn together."),
      slider, form);
    // Keys turn the pictures at once; what had the focus is gone.
    slider.focus({ preventScroll: true });
    window.scrollTo(0, 0);
  }

  function finish() {
    const result = { ballot_answers: 1, ballot: data.ballot, participant, expertise, sheet, answers };
    const text = JSON.stringify(result, null, 1) + "\n";
    const safe = participant.replace(/[^A-Za-z0-9_-]/g, "_");
    const link = element("a", {
      href: URL.createObjectURL(new Blob([text], { type: "application/json" })),
      download: `ballot-${data.ballot}-${safe}.json`, id: "save",
    }, "Save your answers");
    stage.replaceChildren(element("p", {}, "Thank you. Save your answers to a file, and send it to whoever gave you this page."),
      element("p", {}, link));
    link.click();
    link.focus();
  }

  begin();
})();

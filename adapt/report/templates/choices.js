// Controls of the page, and the texts that depend on them.

function fill(select, names, chosen) {
  select.replaceChildren(
    ...names.map((name, k) => {
      const option = document.createElement("option");
      option.value = k;
      option.textContent = name;
      return option;
    }),
  );
  select.value = chosen;
  select.disabled = names.length < 2;
}

function writeWords() {
  const words = {
    ...{ model: model().name, subject: subject().name, motion: motion().name },
    ...{ heat: heatMap() ? heatMap().motion : "", joint: data.joints[at.joint] },
  };
  document.querySelectorAll("[data-name]").forEach((one) => {
    one.textContent = words[one.dataset.name];
  });
  document.querySelectorAll("[data-model]").forEach((one) => {
    one.hidden = one.dataset.model !== model().name;
  });
  element("legend").replaceChildren(
    ...["measured", "before", "after", ...(muscles() ? ["wrapped", "straight"] : [])].map((kind) => {
      const item = document.createElement("span");
      item.className = `key ${kind}`;
      item.textContent = NAME[kind];
      return item;
    }),
  );
}

function writeReadout() {
  const { before, after } = model().states;
  const elevation = data.elevation_deg[row()];
  const parts = [`Posture ${at.posture + 1} of ${motion().rows[1] - motion().rows[0]}`];
  if (elevation !== null) parts.push(`humerus at ${elevation.toFixed(0)}°`);
  parts.push(`root mean square difference ${degrees(before.rms_deg[row()])}° → ${degrees(after.rms_deg[row()])}°`);
  const adaptation = model().adaptation[at.subject];
  if (adaptation !== "ok") parts.push(`adaptation ${adaptation}`);
  [
    ["as it is", before],
    ["adapted", after],
  ].forEach(([name, state]) => {
    if (state.status[row()] !== "ok") parts.push(`fit ${name}: ${state.status[row()]}`);
  });
  if (muscles() && !paths(at.state, row())) parts.push("no muscle lines drawn here");
  element("readout").textContent = parts.join(" · ");
}

function writeSubjects() {
  const cell = (kind, text) => {
    const one = document.createElement(kind);
    one.textContent = text;
    return one;
  };
  const headings = [
    "subject",
    ...data.columns.map((key) => (data.angles.find((angle) => angle.key === key) || { name: key }).name),
    ...data.held_out.map((bone) => `${bone}, held out`),
  ];
  const head = document.createElement("thead");
  head.appendChild(document.createElement("tr")).append(...headings.map((name) => cell("th", name)));
  const body = document.createElement("tbody");
  data.subjects.forEach(({ name }, n) => {
    const line = body.appendChild(document.createElement("tr"));
    const person = cell("th", "");
    person.appendChild(Object.assign(cell("button", name), { type: "button", className: "person" }));
    line.append(
      person,
      ...data.columns.map((_, k) => {
        const one = document.createElement("td");
        one.append(
          Object.assign(cell("span", degrees(model().states.before.gap_deg[n][k])), { className: "before" }),
          " → ",
          cell("b", degrees(model().states.after.gap_deg[n][k])),
        );
        return one;
      }),
      ...data.held_out.map((_, k) => cell("td", degrees(model().held_out_deg[n][k]))),
    );
    line.classList.toggle("chosen", n === at.subject);
    line.addEventListener("click", () => {
      go({ subject: n });
      element("explore").scrollIntoView({ behavior: "smooth" });
      element("subject").focus({ preventScroll: true }); // the chosen row has been rebuilt and lost the focus
    });
  });
  element("subject-table").replaceChildren(head, body);
}

// Apply a change of the choices, and redraw only the parts that depend on it.
function go(change) {
  Object.assign(at, change);
  if ("subject" in change) at.motion = Math.max(0, Math.min(at.motion, subject().motions.length - 1));
  const last = motion().rows[1] - motion().rows[0] - 1;
  at.posture = Math.max(0, Math.min(at.posture, last));
  const wider = ["model", "subject", "motion"].some((key) => key in change);
  if (wider) {
    fill(
      element("motion"),
      subject().motions.map((one) => one.name),
      at.motion,
    );
    element("subject").value = at.subject;
    element("posture").max = last;
    writeSubjects();
  }
  element("posture").value = at.posture;
  ["before", "after"].forEach((state) => element(`show-${state}`).setAttribute("aria-pressed", at.state === state));
  writeReadout();
  drawView();
  if (wider || "posture" in change) {
    drawAngles();
    drawArms();
    drawConstraints();
  }
  if ("model" in change) {
    fill(
      element("heat-motion"),
      model().heat.maps.map((one) => one.motion),
      Math.min(at.heat, model().heat.maps.length - 1),
    );
    drawGaps();
  }
  if ("model" in change || "heat" in change) drawHeat();
  if ("joint" in change) drawArms();
  writeWords();
  writeNumbers();
  if (wider) reachScrollers();
}

let playing = null;
function play() {
  const stop = playing !== null;
  if (stop) {
    clearInterval(playing);
    playing = null;
  } else {
    playing = setInterval(() => go({ posture: (at.posture + 1) % (motion().rows[1] - motion().rows[0]) }), PLAY_MS);
  }
  element("play").textContent = stop ? "play" : "stop";
  element("play").setAttribute("aria-pressed", !stop);
  element("readout").setAttribute("aria-live", stop ? "polite" : "off");
}

fill(
  element("model"),
  data.models.map((one) => one.name),
  at.model,
);
fill(
  element("subject"),
  data.subjects.map((one) => one.name),
  at.subject,
);
["model", "subject", "motion"].forEach((key) =>
  element(key).addEventListener("change", (event) => go({ [key]: Number(event.target.value) })),
);
element("heat-motion").addEventListener("change", (event) => go({ heat: Number(event.target.value) }));
if (muscles()) {
  fill(element("lines"), [...EVERY, ...muscles().muscles].map(spelled), at.lines);
  fill(element("joint"), data.joints, at.joint);
  ["lines", "joint"].forEach((key) =>
    element(key).addEventListener("change", (event) => go({ [key]: Number(event.target.value) })),
  );
}
element("posture").addEventListener("input", (event) => go({ posture: Number(event.target.value) }));
element("previous").addEventListener("click", () => go({ posture: at.posture - 1 }));
element("next").addEventListener("click", () => go({ posture: at.posture + 1 }));
element("play").addEventListener("click", play);
["before", "after"].forEach((state) => element(`show-${state}`).addEventListener("click", () => go({ state })));
document
  .querySelectorAll("[data-view]")
  .forEach((button) =>
    button.addEventListener("click", () => go({ view: button.dataset.view, looks: at.looks + 1 })),
  );
go({ model: at.model, ...mostChanged() });
document.body.dataset.drawn = "yes";

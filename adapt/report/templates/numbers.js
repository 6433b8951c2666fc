// Tables of the numbers in every chart: written when a table is opened, and again after each choice.

// Tabulate columns (name, values) over the postures of the motion, beside posture and elevation.
function overMotion(columns) {
  const first = [
    ["posture", inMotion(data.posture)],
    ["humerus elevation, °", inMotion(data.elevation_deg)],
  ];
  return byColumn([...first, ...columns]);
}

function byColumn(columns) {
  const rows = columns[0][1].map((_, r) => columns.map(([, values]) => values[r]));
  return [columns.map(([name]) => name), ...rows];
}

const NUMBER_DIGITS = 3;
const STATES = { before: "as it is", after: "adapted" };
const inStates = (name, unit, of) =>
  Object.entries(STATES).map(([state, word]) => [`${name}, ${word}, ${unit}`, inMotion(of(model().states[state], state))]);

function landmarkNumbers() {
  const names = ["SC", ...data.points];
  const places = [
    ["measured", points(model().measured_points_mm, row())],
    ...Object.entries(STATES).map(([state, word]) => [word, points(model().states[state].simulated_points_mm, row())]),
  ];
  const columns = places.flatMap(([word, of]) =>
    ["x", "y", "z"].map((axis, k) => [`${word}, ${axis}, mm`, names.map((name) => of[name] && of[name][k])]),
  );
  return byColumn([["landmark", names.map(spelled)], ...columns]);
}

function angleNumbers() {
  return overMotion(
    data.angles.flatMap(({ name }, k) => [
      [`${name}, measured, °`, inMotion(data.measured_deg[k])],
      ...inStates(name, "°", (state) => state.simulated_deg[k]),
    ]),
  );
}

function constraintNumbers() {
  return overMotion(data.constraints.flatMap((name, k) => inStates(name, "mm", (state) => state.residual_mm[k])));
}

function armNumbers() {
  const arms = (k) => (_, state) => muscles().states[state].arms_mm[at.joint][k];
  return overMotion(muscles().muscles.flatMap((muscle, k) => inStates(spelled(muscle), "mm", arms(k))));
}

function heatNumbers() {
  const rows = Object.entries(STATES).flatMap(([state, word]) =>
    data.angles.map(({ name }, k) => [name, word, ...heatMap()[state][k]]),
  );
  return [["angle", "state", ...heatBins().map((bin) => `${bin}°`)], ...rows];
}

function gapNumbers() {
  const { held_out, in_sample, what } = data.gap[model().name];
  const rows = Object.entries(BONES).flatMap(([bone, name]) =>
    gapKinds().map((kind) => {
      const each = [held_out, in_sample].map((levels) => levels[kind][bone]);
      return [name, GAPS[kind], ...each.flatMap(({ value, low, high }) => [value, low, high])];
    }),
  );
  const levels = [what, "in sample"].flatMap((word) => [`${word}, °`, "low", "high"]);
  return [["bone", "state", ...levels], ...rows];
}

// Tabulate bars that the page holds as text: the value of each bar, with its interval if there is one.
function barNumbers(headings, bars) {
  const text = (bar, part) =>
    [...bar.querySelector(part).childNodes].map((one) => (one.nodeName === "SMALL" ? "" : one.textContent)).join("");
  const rows = [...bars].map((bar) => {
    const [name, value] = [text(bar, ".name"), text(bar, ".value")];
    return [name.trim().replace(/\s+/g, " "), ...value.replace(/[[\],]/g, " ").trim().split(/\s+/)];
  });
  return [headings, ...rows];
}

const shownBars = (place) => document.querySelectorAll(`${place}:not([hidden]) .answer`);
const NUMBERS = {
  budget: () => barNumbers(["step", "gap, °", "low", "high"], shownBars("#gap-budget .gap-budget")),
  ranking: () => barNumbers(["candidate", "probability"], shownBars("#why .diagnosis")),
  view: landmarkNumbers,
  angles: angleNumbers,
  arms: armNumbers,
  heat: () => (heatMap() ? heatNumbers() : [["angle", "state"]]),
  constraints: constraintNumbers,
  gaps: gapNumbers,
};
const written = (value) => (typeof value === "number" ? Number(value.toFixed(NUMBER_DIGITS)) : (value ?? ""));

function writeTable(table, [headings, ...rows]) {
  const line = (kind, values) => {
    const one = document.createElement("tr");
    values.forEach((value) => (one.appendChild(document.createElement(kind)).textContent = written(value)));
    return one;
  };
  const [head, body] = ["thead", "tbody"].map((part) => document.createElement(part));
  head.append(line("th", headings));
  body.append(...rows.map((values) => line("td", values)));
  table.replaceChildren(head, body);
}

// Copy a table as tab-separated text for a spreadsheet; without a clipboard, only select it, to be copied by keys.
async function copyTable(table, said) {
  getSelection().selectAllChildren(table);
  const text = [...table.rows].map((one) => [...one.cells].map((cell) => cell.textContent).join("\t")).join("\n");
  try {
    await navigator.clipboard.writeText(text);
    said.textContent = "copied";
  } catch {
    said.textContent = "selected: copy it with Ctrl+C";
  }
}

// Insert the folder of the page into the commands on the page, where the browser knows the folder.
document.querySelectorAll(".command").forEach((one) => {
  const folder = decodeURIComponent(location.pathname)
    .replace(/[^/]*$/, "")
    .replace(/^\/(?=[A-Za-z]:)/, "");
  one.querySelectorAll(".folder").forEach((place) => {
    if (location.protocol === "file:") place.textContent = `"${folder}"`;
  });
  one.querySelector(".copy").addEventListener("click", async () => {
    const [code, said] = [one.querySelector("code"), one.querySelector("[role=status]")];
    getSelection().selectAllChildren(code);
    try {
      await navigator.clipboard.writeText(code.textContent);
      said.textContent = "copied";
    } catch {
      said.textContent = "selected: copy it with Ctrl+C";
    }
  });
});
element("print").addEventListener("click", () => print());

function writeNumbers() {
  document.querySelectorAll(".numbers[open]").forEach((one) => {
    writeTable(one.querySelector("table"), NUMBERS[one.dataset.of]());
    one.querySelector("[role=status]").textContent = "";
  });
}

document.querySelectorAll(".numbers").forEach((one) => {
  const make = (kind, set) => one.appendChild(Object.assign(document.createElement(kind), set));
  const copy = make("button", { type: "button", textContent: "copy as a table" });
  const said = make("span", { role: "status" });
  const scroll = make("div", { className: "scroll tall" });
  const table = scroll.appendChild(document.createElement("table"));
  copy.addEventListener("click", () => copyTable(table, said));
  one.addEventListener("toggle", () => {
    writeNumbers();
    reachScrollers();
  });
});

"use strict";

// Every figure is drawn from the data element; nothing is computed here but where to draw it.
const data = JSON.parse(document.getElementById("data").textContent);
const at = { model: data.first_model, subject: 0, motion: 0, posture: 0, heat: 0, state: "after" };

// Okabe and Ito's palette: told apart by the colour-blind and, by lightness and line style, in grey print.
const COLOUR = { measured: "#000000", before: "#e69f00", after: "#0072b2", apart: "#cc79a7", thorax: "#8c8c8c" };
const NAME = { before: "model as it is", after: "adapted" };
const LIGHT_TO_DARK = [[0, "#f3f8fd"], [0.5, "#6baed6"], [1, "#08306b"]];
const FONT = { family: "system-ui, 'Segoe UI', Helvetica, Arial, sans-serif", size: 12, color: "#222222" };
const TWO_SIDED_95 = 1.96;
const PLAY_MS = 450;

const element = (id) => document.getElementById(id);
const model = () => data.models[at.model];
const subject = () => data.subjects[at.subject];
const motion = () => subject().motions[at.motion];
const row = () => motion().rows[0] + at.posture;
const inMotion = (column) => column.slice(...motion().rows);
const finite = (values) => values.filter((value) => value !== null);
const narrow = () => window.innerWidth < 700;
const degrees = (value) => (value === null ? "–" : value.toFixed(1));

// --- plots in the plane ------------------------------------------------------------------------------------------

function draw(place, traces, layout) {
  const base = {
    font: FONT, showlegend: false, dragmode: false, hovermode: "closest", autosize: true,
    margin: { l: 44, r: 10, t: 30, b: 38 }, paper_bgcolor: "white", plot_bgcolor: "white",
  };
  const axis = { zeroline: false, gridcolor: "#eeeeee", linecolor: "#bbbbbb", ticks: "outside", tickcolor: "#bbbbbb", fixedrange: true };
  const axes = { xaxis: { ...axis, ...layout.xaxis }, yaxis: { ...axis, ...layout.yaxis } };
  const buttons = { displaylogo: false, responsive: true, modeBarButtons: [["toImage"]], toImageButtonOptions: { format: "svg" } };
  return Plotly.react(place, traces, { ...base, ...layout, ...axes }, buttons);
}

function panels(id, count) {
  const place = element(id);
  while (place.children.length < count) place.appendChild(document.createElement("div")).className = "figure";
  return [...place.children];
}

const title = (text) => ({ text, font: { size: 13 }, x: 0.02, xanchor: "left", y: 0.97, yanchor: "top" });

// Elevation, or the number of the posture where a motion has elevations that were not measured.
function abscissa() {
  const elevation = inMotion(data.elevation_deg);
  const known = !elevation.includes(null);
  return { values: known ? elevation : inMotion(data.posture), name: known ? "humerus elevation, °" : "posture" };
}

function here(x) {
  const line = { color: "#999999", width: 1, dash: "dot" };
  return [{ type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1, line, layer: "below" }];
}

function lines(x, of, states) {
  const style = { before: { dash: "dash", width: 2 }, after: { width: 2.5 } };
  return states.map((state) => ({
    x, y: of(state), mode: "lines+markers", name: NAME[state], line: { color: COLOUR[state], ...style[state] },
    marker: { size: 4 }, hovertemplate: `%{y:.1f} ${NAME[state]}<extra></extra>`,
  }));
}

function drawAngles() {
  const x = abscissa();
  const noise = model().noise_deg;
  const places = panels("angles", data.angles.length);
  const columns = data.angles.map((_, k) => ({
    measured: inMotion(data.measured_deg[k]),
    before: inMotion(model().states.before.simulated_deg[k]),
    after: inMotion(model().states.after.simulated_deg[k]),
  }));
  const extents = columns.map((column) => {
    const values = finite(Object.values(column).flat());
    return values.length ? [Math.min(...values), Math.max(...values)] : [-1, 1];
  });
  const half = Math.max(...extents.map(([low, high]) => (high - low) / 2)) + 3 + (noise || 0);
  data.angles.forEach((angle, k) => {
    const { measured, before, after } = columns[k];
    const band = noise === null ? [] : [
      { x: x.values, y: measured.map((v) => v === null ? null : v - TWO_SIDED_95 * noise), mode: "lines", line: { width: 0 }, hoverinfo: "skip" },
      { x: x.values, y: measured.map((v) => v === null ? null : v + TWO_SIDED_95 * noise), mode: "lines", line: { width: 0 }, fill: "tonexty", fillcolor: "rgba(0,0,0,0.11)", hoverinfo: "skip" },
    ];
    const dots = { x: x.values, y: measured, mode: "markers", name: "measured", marker: { color: COLOUR.measured, size: 6 }, hovertemplate: "%{y:.1f} measured<extra></extra>" };
    const middle = (extents[k][0] + extents[k][1]) / 2;
    const name = finite(measured).length ? angle.name : `${angle.name}: not measured`;
    const layout = {
      title: title(name), shapes: here(x.values[at.posture]),
      xaxis: { title: { text: x.name, standoff: 6 }, nticks: 7 }, yaxis: { range: [middle - half, middle + half], ticksuffix: "°", nticks: 6 },
    };
    draw(places[k], [...band, ...lines(x.values, (state) => ({ before, after })[state], ["before", "after"]), dots], layout);
    whenClicked(places[k]);
  });
}

function drawConstraints() {
  const x = abscissa();
  const places = panels("constraints", data.constraints.length);
  data.constraints.forEach((name, k) => {
    const residual = (state) => inMotion(model().states[state].residual_mm[k]);
    const layout = {
      title: title(name), shapes: here(x.values[at.posture]),
      xaxis: { title: { text: x.name, standoff: 6 }, nticks: 7 },
      yaxis: { ticksuffix: " mm", zeroline: true, zerolinecolor: "#555555", rangemode: "tozero" }, margin: { l: 60, r: 10, t: 30, b: 38 },
    };
    draw(places[k], lines(x.values, residual, ["before", "after"]), layout);
    whenClicked(places[k]);
  });
}

function whenClicked(place) {
  place.removeAllListeners("plotly_click");
  place.on("plotly_click", (event) => go({ posture: event.points[0].pointIndex }));
}

function drawHeat() {
  const { maps, low_deg, bin_deg } = model().heat;
  const chosen = maps[Math.min(at.heat, maps.length - 1)];
  if (!chosen) return;
  const most = Math.max(...finite([...chosen.before, ...chosen.after].flat()), 0);
  const bins = low_deg.map((low) => `${low}–${low + bin_deg}`);
  panels("heat-maps", 2).forEach((place, k) => {
    const state = ["before", "after"][k];
    const heat = {
      type: "heatmap", z: chosen[state], x: bins, y: data.angles.map((angle) => angle.name), zmin: 0, zmax: most, colorscale: LIGHT_TO_DARK,
      texttemplate: "%{z:.1f}", hovertemplate: "%{y}, %{x}°: %{z:.1f}°<extra></extra>", xgap: 1, ygap: 1, hoverongaps: false,
      colorbar: { thickness: 10, ticksuffix: "°", outlinewidth: 0 }, showscale: k === 1 && !narrow(),
    };
    const layout = {
      title: title(NAME[state]), plot_bgcolor: "#dddddd", margin: { l: narrow() ? 132 : 150, r: 10, t: 30, b: narrow() ? 70 : 44 },
      xaxis: { title: { text: "humerus elevation, °", standoff: 6 }, type: "category", tickangle: narrow() ? -60 : 0, ticks: "", showgrid: false },
      yaxis: { autorange: "reversed", ticks: "", showgrid: false, tickfont: { size: narrow() ? 10.5 : 12 } },
    };
    draw(place, [heat], layout);
  });
}

function drawGaps() {
  const gap = data.gap[model().name];
  if (!gap) return;
  const names = { base: "as it is", adapted: "adapted", with_effect: "with effect", noise_floor: "noise alone" };
  const kinds = Object.keys(names).filter((kind) => kind in gap);
  const bones = { all: "both bones", clavicle: "clavicle", scapula: "scapula" };
  panels("gaps", 3).forEach((place, k) => {
    const bone = Object.keys(bones)[k];
    const dots = (levels, name, marker, shift) => {
      const each = kinds.map((kind) => levels[kind][bone]);
      const error = (sign) => each.map((one) => (one.value === null || one.low === null ? 0 : sign * (one.value - (sign > 0 ? one.low : one.high))));
      return {
        x: each.map((one) => one.value), y: each.map((_, n) => n + shift), mode: "markers", name, marker,
        error_x: { type: "data", array: error(-1), arrayminus: error(1), color: marker.line ? marker.line.color : marker.color, thickness: 1.5, width: 0 },
        hovertemplate: `%{x:.2f}° ${name}<extra></extra>`,
      };
    };
    const traces = [
      dots(gap, "held out", { color: COLOUR.after, size: 9 }, -0.12),
      dots(gap.in_sample, "in sample", { color: "white", size: 8, line: { color: "#777777", width: 1.5 } }, 0.16),
    ];
    const layout = {
      title: title(bones[bone]), margin: { l: 84, r: 10, t: 30, b: 38 },
      xaxis: { rangemode: "tozero", title: { text: "mean |gap|, °", standoff: 6 } },
      yaxis: { tickvals: [...kinds.keys()], ticktext: kinds.map((kind) => names[kind]), range: [kinds.length - 0.5, -0.5], showgrid: false, ticks: "" },
    };
    draw(place, traces, layout);
  });
}

// --- the girdle in space -----------------------------------------------------------------------------------------

// Thorax frame (lateral, up, backward) to the plot's (lateral, forward, up), which turns about the vertical.
const placed = ([x, y, z]) => [x, z === null ? null : -z, y];
const axes3 = (points) => [0, 1, 2].map((k) => points.map((point) => (point ? placed(point)[k] : null)));
const xyz = (points) => { const [x, y, z] = axes3(points); return { x, y, z }; };
const MARGIN_MM = 25;

function points(columns, r) {
  const found = { SC: model().sc_mm };
  data.points.forEach((name, k) => {
    const point = [0, 1, 2].map((axis) => columns[3 * k + axis][r]);
    found[name] = point.includes(null) ? null : point;
  });
  return found;
}

function bones(of, colour, name, dash, labelled) {
  const line = (part, names, width, style) => ({
    type: "scatter3d", mode: "lines", ...xyz(names.map((one) => of[one])), line: { color: colour, width, dash: style }, hoverinfo: "skip",
    name: `${name}: ${part}`,
  });
  const whole = of.AC && of.TS && of.AI;
  const names = ["SC", "AC", "TS", "AI"];
  return [
    line("clavicle", ["SC", "AC"], 9, "solid"),
    line("scapula", ["AC", "TS", "AI", "AC"], 5, dash),
    line("attachments", ["SC", "clavicle_conoid", "AC", "scapula_conoid"], 1.5, "solid"),
    line("conoid", ["clavicle_conoid", "scapula_conoid"], 6, "solid"),
    { type: "mesh3d", ...xyz(whole ? [of.AC, of.TS, of.AI] : []), i: whole ? [0] : [], j: whole ? [1] : [], k: whole ? [2] : [], color: colour, opacity: 0.22, hoverinfo: "skip", flatshading: true, lighting: { ambient: 1, diffuse: 0, specular: 0 } },
    {
      type: "scatter3d", mode: labelled ? "markers+text" : "markers", ...xyz(names.map((one) => of[one])), marker: { color: colour, size: 3.5 },
      text: names, textposition: "top center", textfont: { ...FONT, size: 13 }, hovertemplate: `%{text} ${name}<extra></extra>`,
    },
  ];
}

// The part of the ellipsoid above `lowest`, as rings and ribs and a thin surface.
function thorax(theta, lowest) {
  const M_x = model().M_x_mm;
  const [M_y, M_z, A_x, A_y, A_z] = theta;
  if (theta.includes(null)) return [];
  const top = M_y + A_y;
  const bottom = Math.max(M_y - A_y, Math.min(lowest, top - 1));
  const heights = [...Array(17)].map((_, n) => top - (top - bottom) * (n / 16) ** 1.6);
  const ring = (y) => {
    const share = Math.sqrt(Math.max(0, 1 - ((y - M_y) / A_y) ** 2));
    return [...Array(49)].map((_, n) => [M_x + A_x * share * Math.cos((n * Math.PI) / 24), y, M_z + A_z * share * Math.sin((n * Math.PI) / 24)]);
  };
  const rings = heights.map(ring);
  const wires = [...rings.filter((_, n) => n % 2 === 0), ...[...Array(12)].map((_, n) => rings.map((one) => one[4 * n]))];
  const parts = rings.map(axes3);
  const surface = { type: "surface", x: parts.map((p) => p[0]), y: parts.map((p) => p[1]), z: parts.map((p) => p[2]) };
  return [
    { ...surface, showscale: false, opacity: 0.16, colorscale: [[0, "#9a9a9a"], [1, "#9a9a9a"]], hoverinfo: "skip", contours: { x: { highlight: false }, y: { highlight: false }, z: { highlight: false } }, lighting: { ambient: 0.9, diffuse: 0.3, specular: 0 } },
    { type: "scatter3d", mode: "lines", ...xyz(wires.flatMap((wire) => [...wire, null])), line: { color: "#b0b0b0", width: 1 }, hoverinfo: "skip", connectgaps: false },
  ];
}

// Of all postures of the subject in both states, so that nothing jumps from step to step.
function extent() {
  const [start, end] = [subject().motions[0].rows[0], subject().motions.at(-1).rows[1]];
  const columns = [model().measured_points_mm, model().states.before.simulated_points_mm, model().states.after.simulated_points_mm];
  const thoraces = ["before", "after"].map((state) => model().states[state].theta_mm[at.subject]).filter((theta) => !theta.includes(null));
  return [0, 1, 2].map((axis) => {
    const values = [model().sc_mm[axis], ...model().thorax_points_mm[axis]];
    columns.forEach((of) => data.points.forEach((_, k) => values.push(...finite(of[3 * k + axis].slice(start, end)))));
    const low = Math.min(...values), high = Math.max(...values);
    const sizes = thoraces.map(([M_y, M_z, A_x, A_y, A_z]) => [[model().M_x_mm - A_x, model().M_x_mm + A_x], [low, M_y + A_y], [M_z - A_z, M_z + A_z]][axis]);
    return [Math.min(low, ...sizes.map(([a]) => a)) - MARGIN_MM, Math.max(high, ...sizes.map(([, b]) => b)) + MARGIN_MM];
  });
}

const VIEWS = {
  oblique: { x: 0.62, y: -1.2, z: 0.7 }, back: { x: 0.1, y: -1.5, z: 0.12 }, side: { x: 1.5, y: 0, z: 0.12 },
  front: { x: 0.1, y: 1.5, z: 0.12 }, top: { x: 0.05, y: -0.2, z: 1.5 },
};
const camera = (view) => ({ eye: VIEWS[view], up: { x: 0, y: 0, z: 1 }, center: { x: 0.08, y: -0.04, z: 0.02 } });

function drawView() {
  const state = model().states[at.state];
  const measured = points(model().measured_points_mm, row());
  const simulated = points(state.simulated_points_mm, row());
  const [x, y, z] = extent();
  const shown = ["AC", "TS", "AI"].filter((name) => measured[name] && simulated[name]);
  const thorax_points = model().thorax_points_mm;
  const traces = [
    ...thorax(state.theta_mm[at.subject], y[0] + MARGIN_MM),
    { type: "scatter3d", mode: "markers", ...xyz(thorax_points[0].map((_, n) => thorax_points.map((axis) => axis[n]))), marker: { color: COLOUR.thorax, size: 2.5 }, hovertemplate: "thorax point<extra></extra>" },
    { type: "scatter3d", mode: "lines", ...xyz(shown.flatMap((name) => [measured[name], simulated[name], null])), line: { color: COLOUR.apart, width: 4 }, hoverinfo: "skip" },
    ...bones(simulated, COLOUR[at.state], NAME[at.state], at.state === "before" ? "dash" : "solid", !measured.AI),
    ...bones(measured, COLOUR.measured, "measured", "solid", true),
  ];
  const hidden = { visible: false, showspikes: false };
  const range = (limits) => ({ ...hidden, range: limits });
  const scene = {
    xaxis: range(x), yaxis: range([-z[1], -z[0]]), zaxis: range(y), aspectmode: "data", camera: camera("oblique"), dragmode: "turntable", bgcolor: "white",
  };
  const layout = { font: FONT, showlegend: false, margin: { l: 0, r: 0, t: 0, b: 0 }, scene, uirevision: "view", paper_bgcolor: "white", autosize: true };
  return Plotly.react("view", traces, layout, { displaylogo: false, responsive: true, modeBarButtons: [["toImage"]] });
}

// --- choices and words -------------------------------------------------------------------------------------------

function fill(select, names, chosen) {
  select.replaceChildren(...names.map((name, k) => {
    const option = document.createElement("option");
    option.value = k;
    option.textContent = name;
    return option;
  }));
  select.value = chosen;
  select.disabled = names.length < 2;
}

function writeWords() {
  const words = { model: model().name, subject: subject().name, motion: motion().name };
  document.querySelectorAll("[data-name]").forEach((one) => { one.textContent = words[one.dataset.name]; });
  document.querySelectorAll("[data-model]").forEach((one) => { one.hidden = one.dataset.model !== model().name; });
  element("legend").replaceChildren(...["measured", "before", "after"].map((kind) => {
    const item = document.createElement("span");
    item.className = `key ${kind}`;
    item.textContent = NAME[kind] || "measured";
    return item;
  }));
}

function writeReadout() {
  const { before, after } = model().states;
  const elevation = data.elevation_deg[row()];
  const parts = [`Posture ${at.posture + 1} of ${motion().rows[1] - motion().rows[0]}`];
  if (elevation !== null) parts.push(`humerus at ${elevation.toFixed(0)}°`);
  parts.push(`root mean square difference ${degrees(before.rms_deg[row()])}° → ${degrees(after.rms_deg[row()])}°`);
  const adaptation = model().adaptation[at.subject];
  if (adaptation !== "ok") parts.push(`adaptation ${adaptation}`);
  [["as it is", before], ["adapted", after]].forEach(([name, state]) => {
    if (state.status[row()] !== "ok") parts.push(`fit ${name}: ${state.status[row()]}`);
  });
  element("readout").textContent = parts.join(" · ");
}

function writeSubjects() {
  const cell = (kind, text) => { const one = document.createElement(kind); one.textContent = text; return one; };
  const headings = ["subject", ...data.columns.map((key) => (data.angles.find((angle) => angle.key === key) || { name: key }).name)];
  const head = document.createElement("thead");
  head.appendChild(document.createElement("tr")).append(...headings.map((name) => cell("th", name)));
  const body = document.createElement("tbody");
  data.subjects.forEach(({ name }, n) => {
    const line = body.appendChild(document.createElement("tr"));
    line.append(cell("th", name), ...data.columns.map((_, k) => {
      const one = document.createElement("td");
      one.append(Object.assign(cell("span", degrees(model().states.before.gap_deg[n][k])), { className: "before" }), " → ", cell("b", degrees(model().states.after.gap_deg[n][k])));
      return one;
    }));
    line.classList.toggle("chosen", n === at.subject);
    line.addEventListener("click", () => { go({ subject: n }); element("explore").scrollIntoView({ behavior: "smooth" }); });
  });
  element("subject-table").replaceChildren(head, body);
}

// Everything that a change touches is drawn again, nothing else.
function go(change) {
  Object.assign(at, change);
  if ("subject" in change) at.motion = Math.max(0, Math.min(at.motion, subject().motions.length - 1));
  const last = motion().rows[1] - motion().rows[0] - 1;
  at.posture = Math.max(0, Math.min(at.posture, last));
  const wider = ["model", "subject", "motion"].some((key) => key in change);
  if (wider) {
    fill(element("motion"), subject().motions.map((one) => one.name), at.motion);
    element("subject").value = at.subject;
    element("posture").max = last;
    writeWords();
    writeSubjects();
  }
  element("posture").value = at.posture;
  ["before", "after"].forEach((state) => element(`show-${state}`).setAttribute("aria-pressed", at.state === state));
  writeReadout();
  drawView();
  if (wider || "posture" in change) { drawAngles(); drawConstraints(); }
  if ("model" in change) {
    fill(element("heat-motion"), model().heat.maps.map((one) => one.motion), Math.min(at.heat, model().heat.maps.length - 1));
    drawGaps();
  }
  if ("model" in change || "heat" in change) drawHeat();
}

let playing = null;
function play() {
  const stop = playing !== null;
  if (stop) { clearInterval(playing); playing = null; } else {
    playing = setInterval(() => go({ posture: (at.posture + 1) % (motion().rows[1] - motion().rows[0]) }), PLAY_MS);
  }
  element("play").textContent = stop ? "play" : "stop";
  element("play").setAttribute("aria-pressed", !stop);
}

fill(element("model"), data.models.map((one) => one.name), at.model);
fill(element("subject"), data.subjects.map((one) => one.name), at.subject);
["model", "subject", "motion"].forEach((key) => element(key).addEventListener("change", (event) => go({ [key]: Number(event.target.value) })));
element("heat-motion").addEventListener("change", (event) => go({ heat: Number(event.target.value) }));
element("posture").addEventListener("input", (event) => go({ posture: Number(event.target.value) }));
element("previous").addEventListener("click", () => go({ posture: at.posture - 1 }));
element("next").addEventListener("click", () => go({ posture: at.posture + 1 }));
element("play").addEventListener("click", play);
["before", "after"].forEach((state) => element(`show-${state}`).addEventListener("click", () => go({ state })));
document.querySelectorAll("[data-view]").forEach((button) => button.addEventListener("click", () => Plotly.relayout("view", { "scene.camera": camera(button.dataset.view) })));
go({ model: at.model });
document.body.dataset.drawn = "yes";

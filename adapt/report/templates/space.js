// 3-D view of the girdle on its ellipsoid.

// Convert the thorax frame (lateral, up, backward) to the plot's (lateral, forward, up), turning about the vertical.
const placed = ([x, y, z]) => [x, -z, y];
const axes3 = (points) => [0, 1, 2].map((k) => points.map((point) => (point ? placed(point)[k] : null)));
const xyz = (points) => {
  const [x, y, z] = axes3(points);
  return { x, y, z };
};
const MARGIN_MM = 25;

function points(columns, r) {
  const found = { SC: own().sc_mm };
  data.points.forEach((name, k) => {
    const point = [0, 1, 2].map((axis) => columns[3 * k + axis][r]);
    found[name] = point.includes(null) ? null : point;
  });
  return found;
}

function bones(of, colour, name, dash, labelled) {
  const line = (part, names, width, style) => ({
    type: "scatter3d",
    mode: "lines",
    ...xyz(names.map((one) => of[one])),
    line: { color: colour, width, dash: style },
    hoverinfo: "skip",
    name: `${name}: ${part}`,
  });
  const whole = of.AC && of.TS && of.AI;
  const names = ["SC", "AC", "TS", "AI"];
  return [
    line("clavicle", ["SC", "AC"], 9, "solid"),
    line("scapula", ["AC", "TS", "AI", "AC"], 5, dash),
    line("attachments", ["SC", "clavicle_conoid", "AC", "scapula_conoid"], 1.5, "solid"),
    line("conoid", ["clavicle_conoid", "scapula_conoid"], 6, "solid"),
    {
      type: "mesh3d",
      ...xyz(whole ? [of.AC, of.TS, of.AI] : []),
      i: whole ? [0] : [],
      j: whole ? [1] : [],
      k: whole ? [2] : [],
      color: colour,
      opacity: 0.22,
      hoverinfo: "skip",
      flatshading: true,
      lighting: { ambient: 1, diffuse: 0, specular: 0 },
    },
    {
      type: "scatter3d",
      mode: labelled ? "markers+text" : "markers",
      ...xyz(names.map((one) => of[one])),
      marker: { color: colour, size: 3.5 },
      text: names,
      textposition: "top center",
      textfont: { ...FONT, size: 13 },
      hovertemplate: `%{text} ${name}<extra></extra>`,
    },
  ];
}

// Draw the part of the ellipsoid above `lowest` as rings, ribs and a thin surface.
function thorax(theta, lowest) {
  const M_x = own().M_x_mm;
  const [M_y, M_z, A_x, A_y, A_z] = theta;
  if (theta.includes(null)) return [];
  const top = M_y + A_y;
  const bottom = Math.max(M_y - A_y, Math.min(lowest, top - 1));
  const heights = [...Array(17)].map((_, n) => top - (top - bottom) * (n / 16) ** 1.6);
  const ring = (y) => {
    const share = Math.sqrt(Math.max(0, 1 - ((y - M_y) / A_y) ** 2));
    return [...Array(49)].map((_, n) => [
      M_x + A_x * share * Math.cos((n * Math.PI) / 24),
      y,
      M_z + A_z * share * Math.sin((n * Math.PI) / 24),
    ]);
  };
  const rings = heights.map(ring);
  const wires = [
    ...rings.filter((_, n) => n % 2 === 0),
    ...[...Array(12)].map((_, n) => rings.map((one) => one[4 * n])),
  ];
  const parts = rings.map(axes3);
  const surface = { type: "surface", x: parts.map((p) => p[0]), y: parts.map((p) => p[1]), z: parts.map((p) => p[2]) };
  return [
    {
      ...surface,
      showscale: false,
      opacity: 0.16,
      colorscale: [
        [0, "#9a9a9a"],
        [1, "#9a9a9a"],
      ],
      hoverinfo: "skip",
      contours: { x: { highlight: false }, y: { highlight: false }, z: { highlight: false } },
      lighting: { ambient: 0.9, diffuse: 0.3, specular: 0 },
    },
    {
      type: "scatter3d",
      mode: "lines",
      ...xyz(wires.flatMap((wire) => [...wire, null])),
      line: { color: "#b0b0b0", width: 1 },
      hoverinfo: "skip",
      connectgaps: false,
    },
  ];
}

// Return the extent of all postures of the subject in both states, so that the view does not jump between postures.
function extent() {
  const [start, end] = [subject().motions[0].rows[0], subject().motions.at(-1).rows[1]];
  const columns = [
    model().measured_points_mm,
    model().states.before.simulated_points_mm,
    model().states.after.simulated_points_mm,
  ];
  const thoraces = ["before", "after"]
    .map((state) => model().states[state].theta_mm[at.subject])
    .filter((theta) => !theta.includes(null));
  return [0, 1, 2].map((axis) => {
    const values = [own().sc_mm[axis], ...own().thorax_points_mm[axis], ...lineEnds().map((point) => point[axis])];
    columns.forEach((of) => data.points.forEach((_, k) => values.push(...finite(of[3 * k + axis].slice(start, end)))));
    const low = Math.min(...values),
      high = Math.max(...values);
    const sizes = thoraces.map(
      ([M_y, M_z, A_x, A_y, A_z]) =>
        [
          [own().M_x_mm - A_x, own().M_x_mm + A_x],
          [low, M_y + A_y],
          [M_z - A_z, M_z + A_z],
        ][axis],
    );
    return [
      Math.min(low, ...sizes.map(([a]) => a)) - MARGIN_MM,
      Math.max(high, ...sizes.map(([, b]) => b)) + MARGIN_MM,
    ];
  });
}

const VIEWS = {
  oblique: { x: 0.62, y: -1.2, z: 0.7 },
  back: { x: 0.1, y: -1.5, z: 0.12 },
  side: { x: 1.5, y: 0, z: 0.12 },
  front: { x: 0.1, y: 1.5, z: 0.12 },
  top: { x: 0.05, y: -0.2, z: 1.5 },
};
const camera = (view) => ({ eye: VIEWS[view], up: { x: 0, y: 0, z: 1 }, center: { x: 0.08, y: -0.04, z: 0.02 } });

function drawView() {
  const state = model().states[at.state];
  const measured = points(model().measured_points_mm, row());
  const simulated = points(state.simulated_points_mm, row());
  const [x, y, z] = extent();
  const shown = ["AC", "TS", "AI"].filter((name) => measured[name] && simulated[name]);
  const thorax_points = own().thorax_points_mm;
  const traces = [
    ...thorax(state.theta_mm[at.subject], y[0] + MARGIN_MM),
    {
      type: "scatter3d",
      mode: "markers",
      ...xyz(thorax_points[0].map((_, n) => thorax_points.map((axis) => axis[n]))),
      marker: { color: COLOUR.thorax, size: 2.5 },
      hovertemplate: "thorax point<extra></extra>",
    },
    {
      type: "scatter3d",
      mode: "lines",
      ...xyz(shown.flatMap((name) => [measured[name], simulated[name], null])),
      line: { color: COLOUR.apart, width: 4 },
      hoverinfo: "skip",
    },
    ...muscleLines(),
    ...bones(simulated, COLOUR[at.state], NAME[at.state], at.state === "before" ? "dash" : "solid", !measured.AI),
    ...bones(measured, COLOUR.measured, "measured", "solid", true),
  ];
  const hidden = { visible: false, showspikes: false };
  const range = (limits) => ({ ...hidden, range: limits });
  const scene = {
    xaxis: range(x),
    yaxis: range([-z[1], -z[0]]),
    zaxis: range(y),
    aspectmode: "data",
    camera: camera(at.view),
    dragmode: "turntable",
    bgcolor: "white",
  };
  const layout = {
    font: FONT,
    showlegend: false,
    margin: { l: 0, r: 0, t: 0, b: 0 },
    scene,
    uirevision: at.looks, // keeps a view turned by hand until another view is chosen; 0 would keep none
    paper_bgcolor: "white",
    autosize: true,
  };
  return Plotly.react("view", traces, layout, { displaylogo: false, responsive: true, modeBarButtons: [["toImage"]] });
}

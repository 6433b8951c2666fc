// The charts: angles, constraints, heat maps, held-out gaps.

function draw(place, traces, layout) {
  const base = {
    font: FONT,
    showlegend: false,
    dragmode: false,
    hovermode: "closest",
    autosize: true,
    margin: { l: 44, r: 10, t: 30, b: 38 },
    paper_bgcolor: "white",
    plot_bgcolor: "white",
  };
  const axis = {
    zeroline: false,
    gridcolor: "#eeeeee",
    linecolor: "#bbbbbb",
    ticks: "outside",
    tickcolor: "#bbbbbb",
    fixedrange: true,
  };
  const axes = { xaxis: { ...axis, ...layout.xaxis }, yaxis: { ...axis, ...layout.yaxis } };
  const buttons = {
    displaylogo: false,
    responsive: true,
    modeBarButtons: [["toImage"]],
    toImageButtonOptions: { format: "svg" },
  };
  place.setAttribute("role", "group");
  place.setAttribute("aria-label", layout.title.text);
  return Plotly.react(place, traces, { ...base, ...layout, ...axes }, buttons);
}

function panels(id, count) {
  const place = element(id);
  while (place.children.length < count) place.appendChild(document.createElement("div")).className = "figure";
  return [...place.children];
}

const title = (text) => ({ text, font: { size: 13 }, x: 0.02, xanchor: "left", y: 0.97, yanchor: "top" });

// Return the elevation, or the posture number where the elevation was not measured or hardly changes in the motion.
function abscissa() {
  const elevation = inMotion(data.elevation_deg);
  const rises = !elevation.includes(null) && Math.max(...elevation) - Math.min(...elevation) >= LEAST_RISE_DEG;
  return rises
    ? { values: elevation, name: "humerus elevation, °" }
    : { values: inMotion(data.posture), name: "posture" };
}

function here(x) {
  const line = { color: "#999999", width: 1, dash: "dot" };
  return [{ type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1, line, layer: "below" }];
}

function lines(x, of, states) {
  const style = { before: { dash: "dash", width: 2 }, after: { width: 2.5 } };
  return states.map((state) => ({
    x,
    y: of(state),
    mode: "lines+markers",
    name: NAME[state],
    line: { color: COLOUR[state], ...style[state] },
    marker: { size: 4 },
    hovertemplate: `%{y:.1f} ${NAME[state]}<extra></extra>`,
  }));
}

// Draw lower and upper edge of the noise band, filled between; straight across angles that were not measured.
function noiseBand(x, measured, noise) {
  if (noise === null) return [];
  const known = measured.map((_, k) => k).filter((k) => measured[k] !== null);
  const edge = (sign) => ({
    x: known.map((k) => x[k]),
    y: known.map((k) => measured[k] + sign * TWO_SIDED_95 * noise),
    mode: "lines",
    line: { width: 0 },
    hoverinfo: "skip",
  });
  return [edge(-1), { ...edge(1), fill: "tonexty", fillcolor: "rgba(0,0,0,0.11)" }];
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
  const half = Math.max(...extents.map(([low, high]) => (high - low) / 2)) + 3 + TWO_SIDED_95 * (noise || 0);
  data.angles.forEach((angle, k) => {
    const { measured, before, after } = columns[k];
    const dots = {
      x: x.values,
      y: measured,
      mode: "markers",
      name: "measured",
      marker: { color: COLOUR.measured, size: 6 },
      hovertemplate: "%{y:.1f} measured<extra></extra>",
    };
    const middle = (extents[k][0] + extents[k][1]) / 2;
    const name = finite(measured).length ? angle.name : `${angle.name}: not measured`;
    const layout = {
      title: title(name),
      shapes: here(x.values[at.posture]),
      xaxis: { title: { text: x.name, standoff: 6 }, nticks: 7 },
      yaxis: { range: [middle - half, middle + half], ticksuffix: "°", nticks: 6 },
    };
    draw(
      places[k],
      [
        ...noiseBand(x.values, measured, noise),
        ...lines(x.values, (state) => ({ before, after })[state], ["before", "after"]),
        dots,
      ],
      layout,
    );
    whenClicked(places[k]);
  });
}

function drawConstraints() {
  const x = abscissa();
  const places = panels("constraints", data.constraints.length);
  data.constraints.forEach((name, k) => {
    const residual = (state) => inMotion(model().states[state].residual_mm[k]);
    const layout = {
      title: title(name),
      shapes: here(x.values[at.posture]),
      xaxis: { title: { text: x.name, standoff: 6 }, nticks: 7 },
      yaxis: { ticksuffix: " mm", zeroline: true, zerolinecolor: "#555555", rangemode: "tozero" },
      margin: { l: 60, r: 10, t: 30, b: 38 },
    };
    draw(places[k], lines(x.values, residual, ["before", "after"]), layout);
    whenClicked(places[k]);
  });
}

function whenClicked(place) {
  place.removeAllListeners("plotly_click");
  place.on("plotly_click", (event) => go({ posture: event.points[0].pointIndex }));
}

const WIDE_ENOUGH_FOR_BINS = 560; // px; room for six bins and the scale beside them

const heatMap = () => model().heat.maps[Math.min(at.heat, model().heat.maps.length - 1)];
const heatBins = () => model().heat.low_deg.map((low) => `${low}–${low + model().heat.bin_deg}`);

function drawHeat() {
  const chosen = heatMap();
  if (!chosen) return;
  const most = Math.max(...finite([...chosen.before, ...chosen.after].flat()), 0);
  const bins = heatBins();
  panels("heat-maps", 2).forEach((place, k) => {
    const state = ["before", "after"][k];
    const turned = place.clientWidth < WIDE_ENOUGH_FOR_BINS;
    const heat = {
      type: "heatmap",
      z: chosen[state],
      x: bins,
      y: data.angles.map((angle) => angle.name),
      zmin: 0,
      zmax: most,
      colorscale: LIGHT_TO_DARK,
      texttemplate: "%{z:.1f}",
      textfont: { color: "#111111" },
      hovertemplate: "%{y}, %{x}°: %{z:.1f}°<extra></extra>",
      xgap: 1,
      ygap: 1,
      hoverongaps: false,
      colorbar: { thickness: 10, ticksuffix: "°", outlinewidth: 0 },
      showscale: k === 1 && !narrow(),
    };
    const layout = {
      title: title(NAME[state]),
      plot_bgcolor: "#dddddd",
      margin: { l: narrow() ? 132 : 150, r: 10, t: 30, b: turned ? 88 : 44 },
      xaxis: {
        title: { text: "humerus elevation, °", standoff: turned ? 14 : 6 },
        type: "category",
        tickangle: turned ? -60 : 0,
        ticks: "",
        showgrid: false,
      },
      yaxis: { autorange: "reversed", ticks: "", showgrid: false, tickfont: { size: narrow() ? 10.5 : 12 } },
    };
    draw(place, [heat], layout);
  });
}

const GAPS = { base: "as it is", adapted: "adapted", own_bones: "own bones", with_effect: "with causes", noise_floor: "noise alone" };
const BONES = { all: "both bones", clavicle: "clavicle", scapula: "scapula" };
const gapKinds = () => Object.keys(GAPS).filter((kind) => kind in data.gap[model().name].held_out);

function drawGaps() {
  const gap = data.gap[model().name];
  if (!gap) return;
  const kinds = gapKinds();
  panels("gaps", 3).forEach((place, k) => {
    const bone = Object.keys(BONES)[k];
    const dots = (levels, name, marker, shift) => {
      const each = kinds.map((kind) => levels[kind][bone]);
      const error = (sign) =>
        each.map((one) =>
          one.value === null || one.low === null ? 0 : sign * (one.value - (sign > 0 ? one.low : one.high)),
        );
      return {
        x: each.map((one) => one.value),
        y: each.map((_, n) => n + shift),
        mode: "markers",
        name,
        marker,
        error_x: {
          type: "data",
          array: error(-1),
          arrayminus: error(1),
          color: marker.line ? marker.line.color : marker.color,
          thickness: 1.5,
          width: 0,
        },
        hovertemplate: `%{x:.2f}° ${name}<extra></extra>`,
      };
    };
    const traces = [
      dots(gap.held_out, gap.what, { color: COLOUR.after, size: 9 }, -0.12),
      dots(gap.in_sample, "in sample", { color: "white", size: 8, line: { color: "#777777", width: 1.5 } }, 0.16),
    ];
    const layout = {
      title: title(BONES[bone]),
      margin: { l: 84, r: 10, t: 30, b: 38 },
      xaxis: { rangemode: "tozero", title: { text: "mean |gap|, °", standoff: 6 } },
      yaxis: {
        tickvals: [...kinds.keys()],
        ticktext: kinds.map((kind) => GAPS[kind]),
        range: [kinds.length - 0.5, -0.5],
        showgrid: false,
        ticks: "",
      },
    };
    draw(place, traces, layout);
  });
}

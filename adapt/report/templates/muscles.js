// Muscle lines in the 3-D view, and moment arms over elevation; nothing where muscles were not computed.

const muscles = () => (data.muscles ? data.muscles[at.model] : null);
const spelled = (muscle) => muscle.replaceAll("_", " ");
const EVERY = ["all", "none"];

// Return the points of each muscle line in this row and state, by index of the line.
function paths(state, r) {
  const found = muscles() && muscles().states[state].paths[r];
  if (!found) return null;
  return found.map((flat) => flat.flatMap((_, k) => (k % 3 ? [] : [flat.slice(k, k + 3)])));
}

function muscleLines() {
  const here = paths(at.state, row());
  if (!here) return [];
  const chosen = [...EVERY, ...muscles().muscles][at.lines];
  return muscles()
    .muscles.filter((muscle) => chosen === "all" || chosen === muscle)
    .map((muscle) => {
      const mine = here.filter((_, k) => muscles().lines[k].muscle === muscle);
      const wraps = muscles().lines.find((line) => line.muscle === muscle).wraps;
      return {
        type: "scatter3d",
        mode: "lines",
        ...xyz(mine.flatMap((path) => [...path, null])),
        line: { color: wraps ? COLOUR.wrapped : COLOUR.straight, width: wraps ? 4 : 3 },
        name: spelled(muscle),
        hovertemplate: `${spelled(muscle)}<extra></extra>`,
        connectgaps: false,
      };
    });
}

// Return the ends of the lines nearer to the trunk, mostly fixed, in the subject's first posture with lines.
function lineEnds() {
  const [start, end] = [subject().motions[0].rows[0], subject().motions.at(-1).rows[1]];
  const states = muscles() ? Object.values(muscles().states) : [];
  const with_lines = states.flatMap((state) => Object.entries(state.paths).find(([r]) => r >= start && r < end) || []);
  return with_lines.filter(Array.isArray).flatMap((lines) => lines.map((flat) => flat.slice(0, 3)));
}

function drawArms() {
  if (!muscles()) return;
  const x = abscissa();
  const arms = (state, k) => inMotion(muscles().states[state].arms_mm[at.joint][k]);
  const both = (k) => ["before", "after"].flatMap((state) => finite(arms(state, k)));
  const every = muscles().muscles.map((muscle, k) => [muscle, k]);
  const passing = every.filter(([, k]) => Math.max(...both(k), 0) > 0);
  const over = passing.length ? passing : every; // empty figures without moment arms, not the previous ones
  const top = 1.1 * Math.max(...over.flatMap(([, k]) => both(k)), 1);
  const places = panels("arms", over.length);
  over.forEach(([muscle, k], n) => {
    const layout = {
      title: title(spelled(muscle)),
      shapes: here(x.values[at.posture]),
      xaxis: { title: { text: x.name, standoff: 6 }, nticks: 7 },
      yaxis: { range: [0, top], ticksuffix: " mm", nticks: 6 },
      margin: { l: 60, r: 10, t: 30, b: 38 },
    };
    draw(
      places[n],
      lines(x.values, (state) => arms(state, k), ["before", "after"]),
      layout,
    );
    whenClicked(places[n]);
  });
}

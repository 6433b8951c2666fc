"use strict";

// Data of every figure, from the data element; scripts compute only positions on the page.
const data = JSON.parse(document.getElementById("data").textContent);
const at = {
  ...{ model: data.first_model, subject: 0, motion: 0, posture: 0, state: "after" },
  ...{ heat: 0, lines: 0, joint: 0, view: "oblique", looks: 1 },
};

// Find the posture of the first subject whose gap falls most by adaptation; the page opens there.
function mostChanged() {
  const { before, after } = data.models[at.model].states;
  const falls = data.subjects[0].motions.flatMap(({ rows }, k) =>
    Array.from({ length: rows[1] - rows[0] }, (_, p) => {
      const r = rows[0] + p;
      return { motion: k, posture: p, fall: (before.rms_deg[r] ?? 0) - (after.rms_deg[r] ?? Infinity) };
    }),
  );
  const { motion: k, posture } = falls.reduce((most, one) => (one.fall > most.fall ? one : most));
  return { motion: k, posture };
}

// Okabe and Ito's palette: distinguishable for colour-blind readers and, by lightness and line style, in grey print.
const COLOUR = {
  measured: "#000000",
  before: "#e69f00",
  after: "#0072b2",
  apart: "#cc79a7",
  thorax: "#8c8c8c",
  wrapped: "#d55e00",
  straight: "#009e73",
};
const NAME = {
  measured: "measured",
  before: "model as it is",
  after: "adapted",
  wrapped: "muscle round thorax or humerus",
  straight: "straight muscle",
};
// Light enough for dark text to be readable on every colour.
const LIGHT_TO_DARK = [
  [0, "#f7fbff"],
  [1, "#4292c6"],
];
const FONT = { family: "system-ui, 'Segoe UI', Helvetica, Arial, sans-serif", size: 12, color: "#222222" };
const TWO_SIDED_95 = 1.96;
const LEAST_RISE_DEG = 5;
const PLAY_MS = 450;

const element = (id) => document.getElementById(id);
const model = () => data.models[at.model];
const own = () => model().sets[Math.min(at.subject, model().sets.length - 1)];
const subject = () => data.subjects[at.subject];
const motion = () => subject().motions[at.motion];
const row = () => motion().rows[0] + at.posture;
const inMotion = (column) => column.slice(...motion().rows);
const finite = (values) => values.filter((value) => value !== null);
const narrow = () => document.querySelector("main").clientWidth < 700;
const degrees = (value) => (value === null ? "–" : value.toFixed(1));

// What all plots have in common.

import { $, colour, isTouched } from "./format.js";

const SYMBOLS = { o: "circle", x: "x-thin", "^": "triangle-up", v: "triangle-down", D: "diamond", s: "square" };

export function axis(text, more = {}) {
  return { title: { text, standoff: 7 }, gridcolor: colour("grid"), zeroline: false, linecolor: colour("line"), showline: true, ...more };
}

// The marker of a source; outline: width of the edge, unless the marker consists of lines.
export function marker(look, outline = 0.6) {
  const isThin = look.marker === "x";
  return {
    symbol: SYMBOLS[look.marker] ?? "circle", color: look.colour, size: 8,
    line: { width: isThin ? 1.5 : outline, color: isThin ? look.colour : colour("paper") },
  };
}

// Draws a plot, or draws it again.
export function plot(id, traces, layout, config = { displayModeBar: false }) {
  const common = {
    margin: { l: 58, r: 12, t: 10, b: 44 }, hovermode: "closest", dragmode: isTouched() ? false : "pan",
    paper_bgcolor: "transparent", plot_bgcolor: "transparent", font: { color: colour("ink"), size: 13 },
  };
  Plotly.react($(id), traces, { ...common, ...layout }, { displaylogo: false, responsive: true, ...config });
}

// Selects the design of a point that was clicked.
export function onClick(id, listener) {
  $(id).on("plotly_click", ({ points }) => {
    const hit = points.find((point) => point.customdata !== undefined);
    if (hit) listener(hit.customdata);
  });
}

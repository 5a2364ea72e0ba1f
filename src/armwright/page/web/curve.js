// The hypervolume over the iterations, and the gain of each source.

import { set } from "./state.js";
import { $, colour, element, isTouched, number, onTheme, percent, plain } from "./format.js";

const SYMBOLS = { o: "circle", x: "x-thin", "^": "triangle-up", v: "triangle-down", D: "diamond", s: "square" };

let content = null;

export function openCurve(shownContent) {
  content = shownContent;
  $("curve-box").hidden = false;
  drawCurve();
  $("curve").on("plotly_click", ({ points }) => {
    const hit = points.find((point) => point.customdata !== undefined);
    if (hit) set({ design: hit.customdata });
  });
  onTheme(drawCurve);
}

export function drawCurve() {
  $("curve-box").querySelector("h2").textContent =
    content.head.is_study ? "Hypervolume by source" : "Hypervolume";
  const search = content.head.result.search;
  const traces = search ? ofSearch(search) : ofStudy();
  const best = content.head.best_known;
  const layout = {
    xaxis: {
      title: { text: search ? "Designs evaluated" : content.head.is_study ? `Iteration (after ${content.nInit} random designs)` : "Designs of the front", standoff: 6 },
      type: search ? "log" : "linear", gridcolor: colour("grid"), zeroline: false, linecolor: colour("line"), showline: true,
    },
    yaxis: {
      title: { text: "Hypervolume", standoff: 8 }, rangemode: "tozero", gridcolor: colour("grid"), zeroline: false,
      linecolor: colour("line"), showline: true,
    },
    shapes: best === null ? [] : [{
      type: "line", xref: "paper", x0: 0, x1: 1, y0: best, y1: best,
      line: { color: colour("missed"), width: 1.2, dash: "dash" },
      label: { text: `best known ${number(best)}`, textposition: "start", font: { color: colour("missed"), size: 11 }, yanchor: "bottom" },
    }],
    margin: { l: 58, r: 12, t: 14, b: 42 }, showlegend: false, hovermode: "closest", dragmode: isTouched() ? false : "pan",
    paper_bgcolor: "transparent", plot_bgcolor: "transparent", font: { color: colour("ink"), size: 13 },
  };
  if (best !== null) layout.yaxis.range = [0, 1.08 * Math.max(best, ...content.curve.slice(-1))];
  Plotly.react($("curve"), traces, layout, { displaylogo: false, responsive: true, displayModeBar: false });
  gains();
}

function ofStudy() {
  const { curve } = content, first = content.nInit;
  const traces = [{
    x: [...curve.keys()].map((i) => i - first + 1), y: [...curve], mode: "lines", line: { color: colour("ink"), width: 1.6, shape: "hv" },
    hoverinfo: "skip",
  }];
  for (const source of content.head.sources) {
    const look = content.head.looks[source];
    const hits = [...curve.keys()].filter((i) => content.source(i) === source && curve[i] > (curve[i - 1] ?? 0));
    traces.push({
      x: hits.map((i) => i - first + 1), y: hits.map((i) => curve[i]), customdata: hits, mode: "markers",
      text: hits.map((i) => plain(`#${i} ${content.joints(i)}: +${number(curve[i] - (curve[i - 1] ?? 0), 3)}`)),
      hovertemplate: `%{text}<extra>${plain(look.label)}</extra>`,
      marker: {
        symbol: SYMBOLS[look.marker] ?? "circle", color: look.colour, size: 8,
        line: { width: look.marker === "x" ? 1.5 : 0.6, color: look.marker === "x" ? look.colour : colour("paper") },
      },
    });
  }
  return traces;
}

function ofSearch(search) {
  return [{
    x: search.map(([n]) => n), y: search.map(([, volume]) => volume), mode: search.length > 1 ? "lines" : "markers", marker: { color: colour("ink") },
    line: { color: colour("ink"), width: 1.6, shape: "hv" }, hovertemplate: "%{x} designs: %{y:.4g}<extra></extra>",
  }];
}

// The gain of a design is the hypervolume that it added when it was evaluated.
function gains() {
  const { curve } = content, gained = new Map();
  if (content.head.result.search || !curve.length) {
    $("gains").replaceChildren();
    return;
  }
  for (let i = 0; i < curve.length; i++) {
    const source = content.source(i);
    gained.set(source, (gained.get(source) ?? 0) + curve[i] - (curve[i - 1] ?? 0));
  }
  const whole = curve.at(-1) || 1;
  $("gains").replaceChildren(...[...gained].map(([source, sum]) => {
    const look = content.head.looks[source];
    const dot = element("span", { class: "dot" });
    dot.style.background = look.colour;
    return element("span", {}, dot, `${look.label}: ${number(sum, 3)} (${percent(sum / whole, 0)})`);
  }));
}

// The hypervolume over the iterations, and the gain of each source.

import { set } from "./state.js";
import { axis, marker, onClick, plot } from "./plot.js";
import { $, colour, dot, element, number, onTheme, percent, plain } from "./format.js";

let content = null;

export function openCurve(shownContent) {
  content = shownContent;
  $("curve-box").hidden = false;
  drawCurve();
  onClick("curve", (design) => set({ design }));
  onTheme(drawCurve);
}

function drawCurve() {
  $("curve-box").querySelector("h2").textContent =
    content.head.is_study ? "Hypervolume by source" : "Hypervolume";
  const search = content.head.result.search;
  const traces = search ? ofSearch(search) : ofStudy();
  const best = content.head.best_known;
  const layout = {
    xaxis: axis(search ? "Designs evaluated" : content.head.is_study ? `Iteration (after ${content.nInit} random designs)` : "Designs of the front",
      { type: search ? "log" : "linear" }),
    yaxis: axis("Hypervolume", { rangemode: "tozero" }),
    shapes: best === null ? [] : [{
      type: "line", xref: "paper", x0: 0, x1: 1, y0: best, y1: best,
      line: { color: colour("missed"), width: 1.2, dash: "dash" },
      label: { text: `best known ${number(best)}`, textposition: "start", font: { color: colour("missed"), size: 11 }, yanchor: "bottom" },
    }],
    showlegend: false,
  };
  if (best !== null) layout.yaxis.range = [0, 1.08 * Math.max(best, ...content.curve.slice(-1))];
  plot("curve", traces, layout);
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
      marker: marker(look),
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
    return element("span", {}, dot(look.colour), `${look.label}: ${number(sum, 3)} (${percent(sum / whole, 0)})`);
  }));
}

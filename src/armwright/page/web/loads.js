// Torque and speed of each joint of a recommended design along the cycle, as shares of their limits.

import { listen, state } from "./state.js";
import { axis, plot } from "./plot.js";
import { $, colour, number, onTheme, plain } from "./format.js";

const PAINTS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B", "#7F7F7F"];

let content = null, kind = "torque";

export function openLoads(shownContent) {
  content = shownContent;
  for (const button of $("load-kinds").querySelectorAll("button")) {
    button.addEventListener("click", () => {
      kind = button.dataset.kind;
      for (const other of $("load-kinds").querySelectorAll("button")) other.setAttribute("aria-pressed", other === button);
      drawLoads();
    });
  }
  listen((changed) => { if (changed.has("design")) drawLoads(); });
  onTheme(drawLoads);
  drawLoads();
}

function drawLoads() {
  const known = content.head.recommended.filter((one) => one.loads !== null);
  $("loads-box").hidden = !known.length;
  if (!known.length) return;
  const chosen = known.find((one) => one.design === state.design), { loads, design } = chosen ?? known[0];
  $("loads-box").querySelector("h2").textContent = `Along the cycle: #${design}`;
  const limits = kind === "torque" ? loads.peak : loads.no_load, values = loads[kind];
  const unit = (j) => (kind === "torque" ? (loads.slides[j] ? "N" : "N m") : loads.slides[j] ? "m/s" : "rad/s");
  const n = values[0].length, time = Array.from({ length: n }, (_, k) => ((k + 0.5) / n) * loads.seconds);
  const traces = values.map((row, j) => ({
    x: time, y: row.map((value) => (limits[j] ? (100 * value) / limits[j] : null)), mode: "lines", line: { color: PAINTS[j % PAINTS.length], width: 1.6 },
    name: plain(`joint ${j + 1}`), text: row.map((value) => `${number(value, 3)} ${unit(j)}`),
    hovertemplate: `%{x:.2f} s: %{text}, %{y:.0f} %<extra>joint ${j + 1}</extra>`,
  }));
  const line = (y) => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y, line: { color: colour("missed"), width: 1.2, dash: "dash" } });
  const layout = {
    xaxis: axis("Time [s]"),
    yaxis: axis(kind === "torque" ? "Torque [% of peak]" : "Speed [% of no-load]", { range: [-108, 108], zeroline: true, zerolinecolor: colour("line") }),
    shapes: [line(100), line(-100)], legend: { orientation: "h", y: -0.22, font: { size: 12 } },
  };
  plot("loads", traces, layout);
  const most = values.map((row, j) => `${j + 1}: ${number(Math.max(...row.map(Math.abs)), 3)} of ${limits[j] === null ? "an unknown limit" : number(limits[j], 3)} ${unit(j)}`);
  const rated = kind === "torque" ? loads.continuous.map((value, j) => (value === null ? null : `${j + 1}: ${number(value, 3)}`)).filter((text) => text !== null) : [];
  const forever = rated.length ? ` Torque that can be held forever, by joint: ${rated.join("; ")}.` : "";
  const factor = kind === "torque" ? " Torques include friction, rotors and the safety factor." : "";
  const other = chosen ? "" : ` Only recommended designs have this plot; #${design} is shown.`;
  $("loads-note").textContent = `Largest by joint, ${most.join("; ")}.${forever}${factor}${other}`;
}

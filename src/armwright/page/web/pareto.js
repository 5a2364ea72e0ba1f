// The designs in the plane of two objectives: their sources, their front and the selected design.

import { describeDominance } from "./existing.js";
import { listen, set, state } from "./state.js";
import { axis, marker, onClick, plot } from "./plot.js";
import { $, colour, element, number, onTheme, plain, plural, title } from "./format.js";

const VIEW = 1.35; // initial range of the axes, as a multiple of the reference point
const FAR = 2; // times the largest value; an axis does not reach to a reference point beyond
const FITTED = 1.1; // range of such an axis, as a multiple of the largest value
const SIMILAR = 0.5; // share of the range; if all values are above, the axis begins near them
const PRECISE = 0.02; // errors below this share of the axis count as precise
const FLOOR = 1e-4; // [m] smaller errors are drawn here on a logarithmic axis; on a short one, at this share of it
const DENSE = 100; // from this number of designs on a front, markers have no outlines
const MARKS = [0.05, 0.35, 0.65, 1]; // shares of the iterations: 10, 70, 130, 200 of 200
const CONFIG = { plotlyServerURL: "", modeBarButtons: [["zoom2d", "pan2d"], ["zoomIn2d", "zoomOut2d", "resetScale2d"]] };

let content = null;
let x = 0, y = 1, log = false, floor = FLOOR;

export function openPareto(shownContent) {
  content = shownContent;
  if (content.objectives.length < 2) return;
  $("front-box").hidden = false;
  for (const [id, chosen] of [["x-axis", 0], ["y-axis", 1]]) {
    content.objectives.forEach((o, k) => $(id).append(new Option(o.label, k, false, k === chosen)));
    $(id).parentElement.hidden = content.objectives.length < 3;
    $(id).addEventListener("change", () => {
      [x, y] = [Number($("x-axis").value), Number($("y-axis").value)];
      draw();
    });
  }
  log = isPrecise();
  $("log").checked = log;
  $("log").addEventListener("change", () => { log = $("log").checked; draw(); });
  $("iteration").addEventListener("input", () => {
    const value = Number($("iteration").value);
    set({ iteration: value >= Number($("iteration").max) ? null : value });
  });
  draw();
  for (const id of ["ring-selected", "ring-compared"]) $("pareto").append(element("div", { class: "ring", id }));
  $("ring-compared").style.borderColor = content.head.colours.target;
  mark();
  for (const event of ["plotly_relayout", "plotly_relayouting", "plotly_afterplot"]) $("pareto").on(event, mark);
  onClick("pareto", (design) => set({ design }));
  listen((changed) => {
    if (changed.has("iteration")) draw();
    else if (changed.has("design") || changed.has("compared")) mark();
  });
  onTheme(draw);
}

// Returns whether errors on the front are so small that only a logarithmic axis separates its designs.
function isPrecise() {
  const reference = content.head.reference_point;
  if (reference === null) return false;
  const small = PRECISE * Math.min(reference[0], range(0)[1]);
  const near = insideBox(content.head.front).filter((i) => content.values(i)[0] < small);
  return near.length > content.head.front.length / 4;
}

// Returns the range of an objective's axis: to beyond the reference point, or to the designs if it is far from all in the
// objective of either axis.
function range(k) {
  const reference = content.head.reference_point;
  if (reference === null) return undefined;
  const all = [...Array(content.n).keys()].filter((i) => content.isEvaluated(i)), feasible = all.filter((i) => content.isFeasible(i));
  const within = (feasible.length ? feasible : all).filter((i) => [x, y].every((m) => content.values(i)[m] <= VIEW * reference[m]));
  const front = frontUntil(content.n), shown = within.length ? within : front.length ? front : all;
  if (!shown.length) return [0, VIEW * reference[k]];
  const largest = (m) => Math.max(...shown.map((i) => content.values(i)[m]));
  const best = Math.min(...shown.map((i) => content.values(i)[k])), worst = largest(k);
  const isFar = [x, y].some((m) => largest(m) > 0 && reference[m] > FAR * largest(m));
  const high = isFar && worst > 0 ? FITTED * worst : VIEW * Math.max(reference[k], within.length ? 0 : worst);
  return [best > SIMILAR * high && best < reference[k] ? best - (FITTED - 1) * (high - best) : 0, high];
}

const insideBox = (numbers) => numbers.filter((i) => content.values(i).every((v, k) => v < content.head.reference_point[k]));

const isProposer = (source) => source === content.head.config.method.proposer?.name;
const counted = () => Math.max(0, content.n - content.nInit);
const until = () => (state.iteration === null ? content.n : content.nInit + state.iteration);
const placed = (value, axis) => (log && axis === 0 ? Math.max(value, floor) : value);

// Returns the feasible designs among the first n that are non-dominated in the shown objectives, by rising x.
function frontUntil(n) {
  const order = [...Array(n).keys()].sort((a, b) => {
    const [u, v] = [content.values(a), content.values(b)];
    return u[x] - v[x] || u[y] - v[y] || a - b;
  });
  let least = Infinity;
  return order.filter((i) => content.isFeasible(i) && content.values(i)[y] < least && ((least = content.values(i)[y]), true));
}

function slider() {
  const total = counted();
  $("iterations").hidden = !content.head.is_study || total < 2;
  const range = $("iteration");
  range.max = total;
  range.value = state.iteration ?? total;
  $("iteration-value").textContent = state.iteration ?? total;
  const planned = content.head.config.method.n_total;
  const marks = MARKS.map((share) => Math.max(1, Math.round(share * planned))).filter((mark) => mark <= total);
  const list = [...new Set(marks)];
  if (list.join() === $("marks").dataset.list) return; // keeps the focus of a button
  $("marks").dataset.list = list.join();
  $("marks").replaceChildren(...list.map((mark) => element("button",
    { type: "button", title: `After ${mark} iterations`, onclick: () => set({ iteration: mark >= counted() ? null : mark }) }, String(mark))));
}

function draw() {
  slider();
  const ranges = new Map([x, y].map((k) => [k, range(k)])), high = (k) => ranges.get(k)?.[1];
  floor = FLOOR * Math.min(1, high(x) ?? 1);
  const n = until(), reference = content.head.reference_point, traces = [], many = content.objectives.length > 2;
  const front = frontUntil(n);
  const inside = reference === null ? front
    : front.filter((i) => content.values(i)[x] < reference[x] && content.values(i)[y] < reference[y]);
  if (inside.length && reference !== null && !many) {
    const xs = [], ys = [];
    inside.forEach((i, k) => {
      const [u, v] = [placed(content.values(i)[x], 0), content.values(i)[y]];
      xs.push(u, u);
      ys.push(k ? content.values(inside[k - 1])[y] : reference[y], v);
    });
    xs.push(reference[x]);
    ys.push(ys.at(-1));
    traces.push({
      x: [...xs, reference[x]], y: [...ys, reference[y]], mode: "none", fill: "toself", fillcolor: colour("area"),
      hoverinfo: "skip", showlegend: false,
    });
    traces.push({
      x: xs, y: ys, mode: "lines", line: { color: colour("ink"), width: 1.5 }, name: "Pareto front", hoverinfo: "skip",
    });
  }
  const onFront = new Set(many && n === content.n ? content.head.front : front);
  const failed = [...Array(n).keys()].filter((i) => content.hasFailed(i));
  const infeasible = [...Array(n).keys()].filter((i) => !content.isFeasible(i) && content.isEvaluated(i));
  if (infeasible.length) {
    traces.push({
      ...points(infeasible), hovertemplate: "%{text}<br>%{x:.4g}, %{y:.4g}<extra>infeasible</extra>", name: "infeasible",
      marker: { symbol: "circle-open", color: content.head.colours.infeasible, size: 7, line: { width: 1 } },
    });
  }
  for (const source of content.head.sources) {
    const look = content.head.looks[source], rows = [];
    for (let i = 0; i < n; i++) if (content.source(i) === source && content.isFeasible(i)) rows.push(i);
    if (!rows.length) continue;
    traces.push({
      ...points(rows), hovertemplate: `%{text}<br>%{x:.4g}, %{y:.4g}<extra>${plain(look.label)}</extra>`, name: plain(look.label),
      marker: {
        ...marker(look, front.length > DENSE ? 0 : 0.6),
        size: rows.map((i) => (onFront.has(i) ? 10 : isProposer(source) ? 9 : 7)),
        opacity: rows.map((i) => (onFront.has(i) ? 1 : isProposer(source) ? 0.9 : 0.55)),
      },
    });
  }
  const existing = content.head.existing_arms.filter((arm) => arm.values[x] !== null && arm.values[y] !== null);
  if (existing.length) {
    const { label, colour: paint } = content.head.existing;
    traces.push({
      x: existing.map((arm) => placed(arm.values[x], 0)),
      y: existing.map((arm) => arm.values[y]),
      text: existing.map((arm) => plain(arm.name)),
      hovertext: existing.map((arm) => plain(`${arm.name}: ${describeDominance(arm)}`)),
      hovertemplate: `%{hovertext}<br>%{x:.4g}, %{y:.4g}<extra>${plain(label)}</extra>`,
      mode: "markers+text", textposition: "top center", cliponaxis: false, name: plain(label),
      marker: { symbol: "cross", size: 12, color: paint, line: { width: 1, color: colour("ink") } },
    });
  }
  if (reference !== null) {
    traces.push({
      x: [reference[x]], y: [reference[y]], mode: "markers", name: "reference point", hoverinfo: "name",
      showlegend: reference[x] <= high(x) && reference[y] <= high(y),
      marker: { symbol: "cross-thin", size: 12, line: { width: 2, color: colour("ink") } },
    });
  }
  const low = Math.max(floor, Math.min(...inside.map((i) => content.values(i)[x]), high(x) ?? 1));
  const layout = {
    xaxis: log ? logarithmic([Math.log10(low / 1.5), Math.log10(high(x) ?? 10)]) : axis(title(content.objectives[x]), { range: ranges.get(x) }),
    yaxis: axis(title(content.objectives[y]), { range: ranges.get(y) }),
    legend: { orientation: "h", y: -64 / Math.max(100, $("pareto").clientHeight - 54), font: { size: 12 } },
    modebar: { bgcolor: "transparent", color: colour("soft"), activecolor: colour("accent") },
    uirevision: `${x} ${y} ${log}`,
  };
  plot("pareto", traces, layout, CONFIG);
  const outside = reference === null ? 0
    : [...Array(n).keys()].filter((i) => content.isEvaluated(i)).filter((i) => content.values(i)[x] > high(x) || content.values(i)[y] > high(y)).length;
  const notes = ["Click a design to see its arm."];
  if (outside) notes.push(`${outside} of ${plural(n, "design")} ${outside === 1 ? "lies" : "lie"} outside this view; zoom out to see more.`);
  if (infeasible.length) notes.push(`Hollow: infeasible, ${infeasible.length} of ${n}.`);
  if (failed.length) notes.push(`Not shown: ${plural(failed.length, "design")} whose evaluation failed.`);
  notes.push(...content.head.existing_arms.map((arm) => whereExisting(arm, high)).filter(Boolean));
  if (many) notes.push("Large: on the front in all objectives; other designs may dominate them in this plane.");
  if (log) notes.push(`Logarithmic: values below ${number(floor)} are drawn at ${number(floor)}.`);
  if (content.head.is_toy) notes.push("Toy masses: use torques to compare designs, not to choose motors.");
  $("pareto-note").textContent = notes.join(" ");
}

// The trace of these designs, without its looks.
const points = (numbers) => ({
  x: numbers.map((i) => placed(content.values(i)[x], 0)), y: numbers.map((i) => content.values(i)[y]), customdata: numbers,
  text: numbers.map((i) => plain(`#${i} ${content.joints(i)}`)), mode: "markers",
});

// Says where an existing arm is that the view does not show; empty for others.
function whereExisting({ name, values }, high) {
  const [u, v] = [values[x], values[y]];
  if (u === null || v === null) return `${name} is not shown, because some of these values are unknown.`;
  const isOutside = high(x) !== undefined && (u > high(x) || v > high(y));
  return isOutside ? `${name} lies outside this view, at ${number(u)}, ${number(v)}.` : "";
}

// The x axis with a range in decades.
const logarithmic = (range) => axis(title(content.objectives[x]),
  { type: "log", range, dtick: range[1] - range[0] > 2 ? 1 : "D2", exponentformat: "power" });

// Rings around the selected and the compared design are elements above the plot: moving them redraws nothing.
function mark() {
  const { xaxis, yaxis } = $("pareto")._fullLayout, [width, height] = [xaxis._length, yaxis._length];
  for (const [id, i] of [["ring-selected", state.design], ["ring-compared", state.compared]]) {
    const ring = $(id);
    ring.hidden = i === null || i >= until() || !content.isEvaluated(i);
    if (ring.hidden) continue;
    const values = content.values(i);
    const [left, top] = [xaxis.d2p(placed(values[x], 0)), yaxis.d2p(values[y])];
    ring.hidden = left < 0 || left > width || top < 0 || top > height;
    ring.style.transform = `translate(${left + xaxis._offset}px, ${top + yaxis._offset}px)`;
  }
}

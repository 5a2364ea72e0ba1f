// The cycle: its steps, how long the tool rests, how far it comes straight in.

import { change, opened } from "./editor-document.js";
import { button, choiceField, length, list, numberField, record, redraw, removal, set, task, textField, unitName, word } from "./editor-fields.js";
import { $, element } from "./format.js";

const COUNTS = ["cycle_time", "price"]; // objectives of a task that gets a cycle and states none, if there are motors
const APPROACH = 0.05; // [m] of a new cycle of picks and places
const DWELL = 0.2; // [s] likewise

const targets = () => list(task().targets);
const nameOf = (t) => record(targets()[t]).name || t + 1;

export function openCycle() {
  const presets = [
    ["Visit in order", () => [set(["cycle"], { steps: targets().map((_, t) => ({ to: nameOf(t) })) }), ...objectives()]],
    ["Pick and place", () => [pickAndPlace(), ...objectives()]],
    ["No cycle", () => [set(["cycle"], null)]],
  ];
  $("cycle-buttons").replaceChildren(...presets.map(([text, edits]) => button(text, () => change({ task: edits() }))));
}

const objectives = () => (task().objectives === undefined && list(record(opened.assessed.space).actuators).length ? [set(["objectives"], COUNTS)] : []);

// Returns a cycle that takes a part at every second target to the one after it.
function pickAndPlace() {
  const steps = targets().slice(0, targets().length - (targets().length % 2)).map((_, t) => ({ to: nameOf(t), do: t % 2 ? "place" : "pick" }));
  const hasAxes = targets().every((entry) => record(entry).axis !== undefined || record(entry).orientation !== undefined);
  return set(["cycle"], { dwell: DWELL, ...(hasAxes ? { approach: APPROACH } : {}), steps });
}

export function drawCycle() {
  const { cycle } = task(), place = $("cycle");
  if (cycle === undefined || cycle === null) {
    redraw(place, element("p", { class: "note" }, "None: the arm reaches each target by itself. With a cycle, moves, times and motors count."));
    return;
  }
  if (typeof cycle !== "object") {
    redraw(place, element("p", { class: "note" }, `In the file: ${cycle}`));
    return;
  }
  const steps = list(cycle.steps);
  redraw(place, element("div", { class: "row" },
    word("rest"), numberField({ id: "cycle-dwell", value: cycle.dwell ?? 0, label: "Rest after each pick and place [s]", size: 4, edit: (v) => ({ task: [set(["cycle", "dwell"], v)] }) }), word("s, approach"), numberField({ id: "cycle-approach", value: cycle.approach, kind: length, optional: true, label: "Length of approach", size: 5, edit: (v) => ({ task: [set(["cycle", "approach"], v)] }) }), word(`${unitName()}, each step`), textField({ id: "cycle-time", value: String(cycle.time ?? "fastest"), label: "Time of each step: seconds, or fastest", size: 6, edit: (text) => ({ task: [set(["cycle", "time"], text === "" || text === "fastest" ? null : Number(text) || text)] }) }), word("s")),
  element("table", {}, element("tbody", {}, ...steps.map(row))),
  button("Add step", () => change({ task: [set(["cycle", "steps", steps.length], { to: nameOf(steps.length % Math.max(1, targets().length)) })] })));
}

function row(step, s) {
  const path = ["cycle", "steps", s], one = record(step);
  const names = targets().map((_, t) => [String(nameOf(t)), String(nameOf(t))]);
  const known = names.some(([name]) => name === String(one.to)) ? names : [...names, [String(one.to), `${one.to}?`]];
  const to = (name) => (/^\d+$/.test(name) ? Number(name) : name);
  return element("tr", {}, ...[
    String(s + 1),
    choiceField({ id: `step-${s}-to`, value: String(one.to), options: known, label: `Target of step ${s + 1}`, edit: (name) => ({ task: [set([...path, "to"], to(name))] }) }),
    choiceField({ id: `step-${s}-by`, value: one.by ?? "joint", options: [["joint", "joint motion"], ["line", "straight line"]], label: `Motion of step ${s + 1}`, edit: (by) => ({ task: [set([...path, "by"], by === "joint" ? null : by)] }) }),
    choiceField({ id: `step-${s}-do`, value: one.do ?? "", options: [["", "pass"], ["pick", "pick"], ["place", "place"]], label: `Action of step ${s + 1}`, edit: (act) => ({ task: [set([...path, "do"], act || null)] }) }),
    removal(`step ${s + 1}`, () => ({ task: [set(path, null)] })),
  ].map((cell) => element("td", {}, cell)));
}

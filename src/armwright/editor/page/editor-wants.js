// Objectives and constraints, chosen from the list of quantities.

import { change } from "./editor-document.js";
import { button, choiceField, list, numberField, record, redraw, removal, set, task } from "./editor-fields.js";
import { $, element, why } from "./format.js";

const CONSTRAINT = /^\s*([A-Za-z_]\w*)\s*(<=|>=)\s*(\S+)\s*$/;
const DEFAULTS = ["position_error", "torque"]; // of a task that states none

let quantities = [];
const named = (name) => quantities.find((one) => one.name === name);

export function openWants(choices) {
  quantities = choices.quantities;
}

// A stated reference point belongs to the stated objectives.
const objectivesEdit = (names) => ({ task: [set(["objectives"], names), ...(task().reference_point === undefined ? [] : [set(["reference_point"], null)])] });

const options = (usable, present) => [
  ...quantities.filter(usable).map(({ name, label, unit }) => [name, unit ? `${label} [${unit}]` : label]),
  ...(present === undefined || quantities.some((one) => one.name === present && usable(one)) ? [] : [[present, `${present}?`]]),
];

const explain = (name) => (named(name) ? why(named(name).label, named(name).description) : "");

export function drawWants() {
  const objectives = task().objectives === undefined ? DEFAULTS : list(task().objectives), constraints = list(task().constraints);
  const minimised = objectives.map((name, k) => element("div", { class: "row" },
    choiceField({ id: `objective-${k}`, value: name, options: options((one) => one.is_objective, name), label: `Objective ${k + 1}`, edit: (other) => objectivesEdit(objectives.with(k, other)) }),
    explain(name),
    objectives.length > 1 ? removal(`objective ${k + 1}`, () => objectivesEdit(objectives.toSpliced(k, 1))) : ""));
  const unused = quantities.find((one) => one.is_objective && !objectives.includes(one.name));
  redraw($("wants"),
    element("div", { class: "row top" }, "Minimised", button("Add", () => change(objectivesEdit([...objectives, unused.name])), { "aria-label": "Add an objective" })), ...minimised,
    element("div", { class: "row top" }, "Required", button("Add", () => change({ task: [set(["constraints"], [...constraints, "price <= 1000"])] }), { "aria-label": "Add a constraint" })),
    ...constraints.map(required), constraints.length ? "" : element("p", { class: "note" }, "Nothing beyond what the cycle implies."));
}

function required(text, k) {
  const path = ["constraints", k], found = CONSTRAINT.exec(text);
  const remove = removal(`constraint ${k + 1}`, () => ({ task: [list(task().constraints).length > 1 ? set(path, null) : set(["constraints"], null)] }));
  if (!found) return element("div", { class: "row" }, String(text), remove);
  const [, name, relation, bound] = found, edit = (...parts) => ({ task: [set(path, parts.join(" "))] });
  return element("div", { class: "row" },
    choiceField({ id: `constraint-${k}-name`, value: name, options: options(() => true, name), label: `Quantity of constraint ${k + 1}`, edit: (other) => edit(other, relation, bound) }),
    choiceField({ id: `constraint-${k}-relation`, value: relation, options: [["<=", "≤"], [">=", "≥"]], label: `Relation of constraint ${k + 1}`, edit: (other) => edit(name, other, bound) }),
    numberField({ id: `constraint-${k}-bound`, value: bound, label: `Bound of constraint ${k + 1}`, edit: (value) => edit(name, relation, value) }),
    named(name)?.unit ?? "", explain(name), remove);
}

// The table of targets: names, positions, tool directions, tolerances; points pasted from a spreadsheet.

import { ask, change, complain, opened } from "./editor-document.js";
import { choiceField, isNumber, length, list, numberField, record, redraw, removal, set, textField, unitName } from "./editor-fields.js";
import { $, element, markRows, plural } from "./format.js";

const MOST_ROWS = 300; // a longer table would be slow
const WAYS = [["any", "any"], ["0,0,-1", "down"], ["0,0,1", "up"], ["1,0,0", "+x"], ["-1,0,0", "−x"], ["0,1,0", "+y"], ["0,-1,0", "−y"]];
const FAR = [0.3, 0, 0.2]; // [m] of a first target

let picked = null;
const listeners = [];

export const chosen = () => picked;
export const listenToChoice = (listener) => listeners.push(listener);

export function choose(index) {
  picked = index;
  markRows($("targets").querySelectorAll("tbody tr"), "target", index);
  for (const listener of listeners) listener();
}

const entries = () => list(opened.assessed.task?.targets);
const asRecord = (entry) => Array.isArray(entry) ? { position: entry } : entry;
const hasDirection = (entry) => wayOf(entry) !== "any";
const positionOf = (entry) => list(Array.isArray(entry) ? entry : record(entry).position);

const placeOf = (index) => (Array.isArray(entries()[index]) ? ["targets", index] : ["targets", index, "position"]);

// Returns the edits that move a target.
export function placeEdit(index, position) {
  return position.map((value, k) => set([...placeOf(index), k], Number(value.toFixed(6))));
}

// Returns the edits that set a key of a target; a plain point becomes a record.
function keyEdit(index, key, value) {
  const entry = entries()[index];
  if (!Array.isArray(entry)) return [set(["targets", index, key], value)];
  return value === null ? [] : [set(["targets", index], key === "name" ? { name: value, position: entry } : { position: entry, [key]: value })];
}

function wayOf(entry) {
  const { axis, orientation } = record(entry);
  if (orientation !== undefined) return "orientation";
  const numbers = list(axis).map(Number), size = Math.hypot(...numbers);
  return axis === undefined ? "any" : numbers.map((v) => Number((v / size).toFixed(4))).join(",");
}

function wayEdit(index, way) {
  const entry = record(entries()[index]), edits = [];
  if (way === "orientation") return edits;
  if (entry.orientation !== undefined) edits.push(set(["targets", index, "orientation"], null));
  if (way !== "any") return [...edits, ...keyEdit(index, "axis", way.split(",").map(Number))];
  for (const key of ["axis", "angle_tolerance"]) if (entry[key] !== undefined) edits.push(set(["targets", index, key], null));
  return edits;
}

export function openTargets({ units }) {
  $("add-target").addEventListener("click", add);
  $("paste-unit").replaceChildren(...units.map((name) => element("option", { value: name }, name)));
  $("paste-way").replaceChildren(...WAYS.map(([key, text]) => element("option", { value: key }, text)));
  $("open-paste").addEventListener("click", () => {
    $("paste").hidden = false;
    $("paste-note").textContent = "";
    $("paste-unit").value = unitName();
    $("paste-text").focus();
  });
  $("close-paste").addEventListener("click", () => { $("paste").hidden = true; });
  $("paste").addEventListener("submit", paste);
}

function add() {
  const last = positionOf(entries().at(-1)), place = last.length === 3 && last.every(isNumber) ? last.map(Number) : FAR;
  const next = [place[0], Number((place[1] + 0.05).toFixed(6)), place[2]];
  choose(entries().length);
  change({ task: entries().length ? [set(["targets", entries().length], next)] : [set(["targets"], [next])] });
}

async function paste(event) {
  event.preventDefault();
  const isReplacing = event.submitter?.value !== "append", way = $("paste-way").value;
  try {
    const { targets, notes } = await ask("points", { text: $("paste-text").value, unit: $("paste-unit").value });
    if (way !== "any" && targets.some(hasDirection)) throw new Error("The pasted text states tool directions; choose any as the tool.");
    const given = way === "any" ? targets : targets.map((entry) => ({ ...asRecord(entry), axis: way.split(",").map(Number) }));
    const known = isReplacing ? [] : entries();
    await change({ task: [...(isReplacing && opened.assessed.task?.cycle !== undefined ? [set(["cycle"], null)] : []), set(["targets"], [...known, ...given])] });
    $("paste").hidden = true;
    $("paste-text").value = "";
    $("paste-note").textContent = notes.map((note) => `Pasted text: ${note}.`).join(" ");
  } catch (fault) {
    complain(fault.message);
  }
}

export function drawTargets() {
  const given = entries(), rows = given.slice(0, MOST_ROWS);
  const heads = ["", "name", ...["x", "y", "z"].map((axis) => `${axis} [${unitName()}]`), "tool points", `tolerance [${unitName()}]`, ""];
  redraw($("targets"), element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", {}, head)))), element("tbody", {}, ...rows.map(row)));
  const more = given.length - rows.length;
  $("targets-note").textContent = more > 0 ? `${plural(more, "further target")} in the file.` : given.length ? "" : "No target yet: add one, or paste points.";
}

function row(entry, t) {
  const position = positionOf(entry), one = record(entry), way = wayOf(entry);
  const ways = WAYS.some(([key]) => key === way) ? WAYS : [...WAYS, [way, way === "orientation" ? "orientation" : `(${way})`]];
  const cells = [
    String(t + 1),
    textField({ id: `target-${t}-name`, value: one.name, label: `Name of target ${t + 1}`, edit: (text) => ({ task: keyEdit(t, "name", text || null) }) }),
    ...[0, 1, 2].map((k) => numberField({
      id: `target-${t}-${k}`, value: position[k], kind: length, label: `${"xyz"[k]} of target ${t + 1}`, edit: (value) => ({ task: [set([...placeOf(t), k], value)] }),
    })),
    choiceField({ id: `target-${t}-way`, value: way, options: ways, label: `Tool direction at target ${t + 1}`, edit: (key) => ({ task: wayEdit(t, key) }) }),
    numberField({
      id: `target-${t}-tolerance`, value: one.tolerance, kind: length, optional: true, label: `Tolerance of target ${t + 1}`, edit: (value) => ({ task: keyEdit(t, "tolerance", value) }),
    }),
    removal(`target ${t + 1}`, () => ({ task: [set(["targets", t], null)] })),
  ];
  const made = element("tr", { "data-target": t, class: t === picked ? "chosen" : "" }, ...cells.map((cell) => element("td", {}, cell)));
  made.addEventListener("focusin", () => choose(t));
  return made;
}

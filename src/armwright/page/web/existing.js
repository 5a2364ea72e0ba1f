// Existing arms beside the recommended designs: what an arm that can be bought does better, and what worse.

import { listen, set, state } from "./state.js";
import { $, element, markRows, plural, quantity, why } from "./format.js";

const MORE = ["reach", "payload_at_full_reach", "payload_capacity"]; // of which more is better

let content = null;
let drawn = ""; // what the table shows, so that it is not drawn again under an open explanation

export function openExisting(shownContent) {
  content = shownContent;
  drawExisting();
  listen((changed) => { if (changed.has("design")) mark(); });
}

function drawExisting() {
  const { existing_arms: arms, quantities, recommended } = content.head, shown = JSON.stringify([arms, recommended]);
  $("existing-box").hidden = !arms.length;
  if (!arms.length || shown === drawn) return;
  drawn = shown;
  const rows = [...recommended.map(ofDesign), ...arms.map(ofArm)];
  const names = [...new Set([...content.objectives.map(({ name }) => name), ...content.head.asked])];
  const columns = names.filter((name) => rows.some((row) => isKnown(row.values[name])))
    .map((name) => ({ name, more: MORE.includes(name), ...content.objectives.find((one) => one.name === name), ...quantities[name], ...rows.find((row) => name in row.facts)?.facts[name] }));
  const best = new Map(columns.map((column) => [column.name, bestOf(column, rows)]));
  const heads = columns.map(({ label, description }) => element("th", {}, label, why(label, description)));
  $("existing").replaceChildren(
    element("thead", {}, element("tr", {}, element("th", { class: "text" }, "Arm"), ...heads, element("th", { class: "text" }, "On this task"))),
    element("tbody", {}, ...rows.map((row) => tableRow(row, columns, best))));
  const note = ["Bold: the best value of a column, among the arms that violate no constraint."];
  if (rows.some((row) => columns.some(({ name }) => !isKnown(row.values[name])))) note.push("–: not stated by the arm's file.");
  if (recommended.length) note.push(`Masses and prices of designs do not include ${content.head.not_modelled}.`);
  $("existing-note").textContent = note.join(" ");
  $("existing-title").textContent = recommended.length ? "Existing arms beside the recommended designs" : "Existing arms";
  mark();
}

const isKnown = (value) => value !== null && value !== undefined;

function ofDesign({ design, facts }) {
  return { name: `#${design} ${content.joints(design)}`, design, facts, verdict: "meets all constraints", ...known(facts, content.values(design)) };
}

function ofArm(arm) {
  const { name, facts, values, violated } = arm;
  return { name, violated, facts, verdict: describeDominance(arm), ...known(facts, values) };
}

// Values and texts of the facts, and the values of the objectives, by name.
function known(facts, minimised) {
  const values = {}, texts = {};
  for (const [name, { value, text }] of Object.entries(facts)) [values[name], texts[name]] = [value, text];
  content.objectives.forEach((one, k) => { [values[one.name], texts[one.name]] = [minimised[k], quantity(minimised[k], one.unit)]; });
  return { values, texts };
}

function bestOf({ name, more }, rows) {
  const values = rows.filter((row) => !row.violated?.length).map((row) => row.values[name]).filter(isKnown);
  return new Set(values).size > 1 ? Math[more ? "max" : "min"](...values) : null;
}

function tableRow({ name, values, texts, design, violated, verdict }, columns, best) {
  const cells = columns.map((column) => {
    const value = values[column.name] ?? null;
    const text = value === null ? "–" : texts[column.name];
    return element("td", {}, !violated?.length && value !== null && value === best.get(column.name) ? element("strong", {}, text) : text);
  });
  const first = design === undefined ? name : element("button", { type: "button", onclick: () => set({ design }) }, name);
  return element("tr", { "data-design": design ?? null }, element("td", { class: "text" }, first), ...cells,
    element("td", { class: `text wrap${violated?.length ? " missed" : ""}` }, verdict));
}

// Whether one arm is worse than another in no objective and better in one.
const dominates = (one, other) => one.every((v, k) => v <= other[k]) && one.some((v, k) => v < other[k]);

export function describeDominance({ violated, values }) {
  if (violated.length) return `violates ${violated.join(", ")}`;
  const unknown = content.objectives.filter((_, k) => values[k] === null).map(({ label }) => label.toLowerCase());
  if (unknown.length) return `not comparable with the front: ${unknown.join(", ")} unknown`;
  const front = content.head.front.map((i) => content.values(i));
  if (!front.length) return "not comparable: there is no front";
  const worse = front.filter((other) => dominates(values, other)).length;
  return `dominates ${plural(worse, "design")} of the front, dominated by ${front.filter((other) => dominates(other, values)).length}`;
}

function mark() {
  markRows($("existing").querySelectorAll("tr[data-design]"), "design", state.design);
}

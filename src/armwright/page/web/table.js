// The Pareto front as a table: sorted by any column, linked to what is selected.

import { showRow } from "./design.js";
import { listen, set, state } from "./state.js";
import { $, element, heading, markRows, metres, number, plural } from "./format.js";

let content = null;
let sorted = { key: "0", up: true };
let only = null; // numbers of the selected designs, in order; null: the whole front

export function openTable(shownContent) {
  content = shownContent;
  $("table-box").hidden = false;
  drawTable();
  drawMeanings();
  listen((changed) => { if (changed.has("design")) mark(); });
}

function columns() {
  const { head } = content;
  const made = [
    { key: "number", name: "#", value: (i) => i },
    { key: "source", name: "source", text: true, value: (i) => content.look(i).label },
    ...content.objectives.map((o, k) => ({
      key: String(k), name: heading(o), value: (i) => content.values(i)[k],
    })),
  ];
  if (head.result.verdict !== null) made.push({ key: "verdict", name: "verdict", text: true, value: (i) => content.verdict(i) });
  if (head.front.some((i) => "reserve" in head.arms[i])) made.push({ key: "reserve", name: "reserve", value: (i) => head.arms[i].reserve });
  made.push({ key: "joints", name: "joints", text: true, value: (i) => content.joints(i) });
  for (const name of ["mount", "tube"]) {
    if (!head.parameters.some((p) => p.name === name)) continue;
    made.push({ key: name, name, text: true, value: (i) => content.param(i, name) });
  }
  for (const kind of ["direction", "tube", "motor"]) {
    if (!head.parameters.some((p) => p.name.startsWith(`${kind}_`))) continue;
    made.push({ key: kind, name: `${kind}s`, text: true, value: (i) => content.chosen(i, kind).join(", ") });
  }
  for (const p of head.parameters.filter((p) => p.custom && p.choices)) {
    made.push({ key: p.name, name: p.name.replaceAll("_", " "), text: true, value: (i) => content.param(i, p.name) });
  }
  for (const p of head.parameters.filter((p) => !p.choices)) {
    const form = (value) => (value === undefined ? "–" : (p.unit === "m" ? metres : number)(value));
    made.push({ key: p.name, name: p.name.replaceAll("_", " ") + (p.unit ? ` [${p.unit}]` : ""), form, value: (i) => content.param(i, p.name) });
  }
  return made;
}

// Explains the objectives and the quantities that constraints bound.
function drawMeanings() {
  const { head } = content, names = [...content.objectives.map((o) => o.name), ...head.constraints.map((c) => c.name)];
  const known = [...new Set(names)].filter((name) => name in head.quantities).map((name) => head.quantities[name]);
  $("meanings").hidden = !known.length;
  $("meanings").querySelector("dl").replaceChildren(...known.flatMap((quantity) =>
    [element("dt", {}, heading(quantity)), element("dd", {}, quantity.description)]));
}

// Shows only these designs of the front, in this order until the table is sorted by a column.
export function show(numbers) {
  only = numbers;
  sorted = only === null ? { key: "0", up: true } : { key: null, up: true };
  drawTable();
}

function drawTable() {
  const all = columns(), by = all.find((column) => column.key === sorted.key), { front } = content.head;
  const rows = only === null ? [...front] : only.filter((i) => front.includes(i));
  if (by) {
    rows.sort((a, b) => {
      const [u, v] = [by.value(a), by.value(b)];
      return (sorted.up ? 1 : -1) * (by.text ? String(u).localeCompare(String(v)) : (u ?? 0) - (v ?? 0)) || a - b;
    });
  }
  const head = element("tr", {}, ...all.map((column) => {
    const arrow = column === by ? (sorted.up ? " ▲" : " ▼") : "";
    const sort = () => {
      sorted = { key: column.key, up: column === by ? !sorted.up : true };
      drawTable();
      $("table").querySelectorAll("th button")[all.indexOf(column)].focus();
    };
    const order = column === by ? (sorted.up ? "ascending" : "descending") : null;
    return element("th", { class: column.text ? "text" : "", scope: "col", "aria-sort": order },
      element("button", { type: "button", onclick: sort }, column.name + arrow));
  }));
  const body = rows.map((i) => element("tr", { "data-design": i, tabindex: "0", onclick: () => set({ design: i }), onkeydown: step },
    ...all.map((column) => {
      const value = column.value(i);
      return element("td", { class: column.text ? "text" : "" }, column.text || column.key === "number" ? String(value) : (column.form ?? number)(value));
    })));
  const focused = document.activeElement?.closest?.("#table tbody tr")?.dataset.design;
  $("table").replaceChildren(element("thead", {}, head), element("tbody", {}, ...body));
  if (focused !== undefined) $("table").querySelector(`tr[data-design="${focused}"]`)?.focus({ preventScroll: true });
  $("table-title").textContent = `Pareto front: ${rows.length < front.length ? `${rows.length.toLocaleString("en")} of ` : ""}${plural(front.length, "design")}`;
  mark();
}

function step(event) {
  const row = event.currentTarget;
  if (event.key === "Enter" || event.key === " ") set({ design: Number(row.dataset.design) });
  else if (event.key === "ArrowDown" || event.key === "ArrowUp") {
    const other = event.key === "ArrowDown" ? row.nextElementSibling : row.previousElementSibling;
    if (other) {
      other.focus();
      set({ design: Number(other.dataset.design) });
    }
  } else return;
  event.preventDefault();
}

function mark() {
  showRow(markRows($("table").querySelectorAll("tbody tr"), "design", state.design));
}

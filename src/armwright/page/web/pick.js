// Choose a design of the front by conditions and a ranking, as `armwright pick` does (proof/selection.py).

import { set } from "./state.js";
import { show } from "./table.js";
import { $, number, plural } from "./format.js";

const NUMBER = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?";
const CONDITION = new RegExp(`^\\s*([A-Za-z_]\\w*)\\s*(<=|>=|<|>)\\s*(${NUMBER})\\s*$`);
const HOLDS = { "<=": (a, b) => a <= b, ">=": (a, b) => a >= b, "<": (a, b) => a < b, ">": (a, b) => a > b };
const KNEE = ""; // no number has such a name

let content = null;
let names = [];

export function openPick(shownContent) {
  content = shownContent;
  names = [...new Set([...content.objectives.map((o) => o.name), ...content.head.front.flatMap((i) => Object.keys(content.head.arms[i])),
    ...content.head.parameters.filter((p) => !p.choices).map((p) => p.name)])];
  $("pick-by").append(new Option("the knee", KNEE), ...names.map((name) => new Option(`least ${name}`, name)));
  $("pick-where").placeholder = `such as ${content.objectives[0].name}<=0.05, length<1`;
  $("pick").addEventListener("submit", (event) => {
    event.preventDefault();
    choose();
  });
  $("pick-all").addEventListener("click", forget);
  drawPick();
}

function drawPick() {
  $("pick-holds").parentElement.hidden = content.head.result.verdict === null;
}

// Shows the whole front again; the form keeps its values.
function forget() {
  $("pick-message").textContent = "";
  $("pick-all").hidden = true;
  show(null);
}

// Returns the quantities of a design that conditions and rankings can use.
function numbersOf(i) {
  const names = content.head.parameters.filter((p) => !p.choices).map((p) => p.name);
  const found = new Map(names.map((name) => [name, content.param(i, name) ?? 0]));
  for (const [name, value] of Object.entries(content.head.arms[i])) found.set(name, value);
  content.objectives.forEach((o, k) => found.set(o.name, content.values(i)[k]));
  return found;
}

// The knee of these designs of a front first, then what lies nearest to its corner (pareto.py, knee_index).
export function ranked(shownContent, numbers) {
  const { reference_point: reference } = shownContent.head;
  const values = new Map(numbers.map((i) => [i, Array.from(shownContent.values(i))]));
  const far = new Map(numbers.map((i) => [i, Math.hypot(...values.get(i).map((v, k) => (reference ? v / reference[k] : v)))]));
  const order = [...numbers].sort((a, b) => far.get(a) - far.get(b) || a - b);
  const inside = numbers.filter((i) => !reference || values.get(i).every((v, k) => v < reference[k]));
  if (inside.length < 3) return order;
  const low = values.get(inside[0]).map((_, k) => Math.min(...inside.map((i) => values.get(i)[k])));
  const span = low.map((least, k) => Math.max(...inside.map((i) => values.get(i)[k])) - least || 1);
  const below = (i) => values.get(i).reduce((sum, v, k) => sum + (v - low[k]) / span[k], 0);
  const knee = inside.reduce((best, i) => (below(i) < below(best) ? i : best));
  return [knee, ...order.filter((i) => i !== knee)];
}

const split = (text) => text.split(",").filter((part) => part.trim());

function known(name, allowed) {
  if (!allowed.includes(name)) throw new Error(`Unknown quantity "${name}"; available: ${allowed.join(", ")}`);
  return name;
}

function conditions() {
  return split($("pick-where").value).map((part) => {
    const found = CONDITION.exec(part);
    if (!found) throw new Error(`"${part.trim()}": expected a name, one of <= < >= >, and a number, such as mass<=2.5`);
    return { name: known(found[1], names), relation: found[2], bound: Number(found[3]) };
  });
}

function ordered(left, quantities) {
  const by = $("pick-by").value;
  if (by === KNEE) return ranked(content, left);
  const value = (i) => quantities.get(i).get(by);
  return [...left].sort((a, b) => value(a) - value(b) || a - b);
}

// Explains an empty selection by the first condition that no design meets.
function nearestMiss(requested, quantities) {
  if (!quantities.size) return "No design meets all constraints yet.";
  for (const { name, relation, bound } of requested) {
    const values = [...quantities.values()].map((numbers) => numbers.get(name));
    if (values.some((value) => HOLDS[relation](value, bound))) continue;
    const nearest = relation.startsWith("<") ? Math.min(...values) : Math.max(...values);
    return `No design of the front has ${name} ${relation} ${bound}; the nearest has ${number(nearest)}.`;
  }
  return "No design of the front meets all conditions at once.";
}

function choose() {
  const quantities = new Map(content.head.front.map((i) => [i, numbersOf(i)]));
  const message = $("pick-message");
  try {
    const requested = conditions(), holds = $("pick-holds").checked;
    const left = content.head.front.filter((i) => (
      (!holds || content.isGood(i)) && requested.every(({ name, relation, bound }) => HOLDS[relation](quantities.get(i).get(name), bound))
    ));
    const order = ordered(left, quantities);
    message.classList.toggle("missed", !order.length);
    if (!order.length) {
      message.textContent = nearestMiss(requested, quantities);
      return;
    }
    show(order);
    $("pick-all").hidden = false;
    message.textContent = `Design ${order[0]}, of ${plural(order.length, "design")} in the selection. ${command(requested, holds)}`;
    set({ design: order[0] });
  } catch (fault) {
    message.classList.add("missed");
    message.textContent = fault.message;
  }
}

// Returns the same selection as a command.
function command(requested, holds) {
  const by = $("pick-by").value;
  const parts = requested.map(({ name, relation, bound }) => `--where "${name}${relation}${bound}"`);
  if (by !== KNEE) parts.push(`--by ${by}`);
  if (holds) parts.push("--holds");
  return `In a terminal: armwright pick RUN ${parts.join(" ")}`.trim();
}

// The designs to build, or why there is none: what an engineer reads first.

import { snapshot } from "./arm.js";
import { downloadOf } from "./design.js";
import { listen, set, state } from "./state.js";
import { $, element, markRows, millimetres, onTheme, plural, quantity, why } from "./format.js";

const ROLES = {
  knee: "Best compromise", safe: "Safe", "least price": "Cheapest", "least deflection": "Stiffest", "least cycle time": "Fastest", "least mass": "Lightest",
};

let content = null;

export const isForEngineers = (head) => head.constraints.length > 0;

export function openRecommended(shownContent) {
  content = shownContent;
  drawRecommended();
  listen((changed) => { if (changed.has("design")) mark(); });
  onTheme(drawPictures);
}

// Puts the search in numbers after the designs of a task with constraints; for the paper's tasks it comes first.
export function arrange(head) {
  if (!isForEngineers(head)) return;
  for (const id of ["curve-box", "transcript-box", "configuration-box"]) {
    $(id).parentElement.append($(id));
  }
  $("curve-box").classList.add("wide");
}

function drawRecommended() {
  const { recommended, nothing } = content.head;
  $("recommended-box").hidden = !recommended.length && nothing === null;
  $("nothing").hidden = nothing === null;
  $("recommended-box").querySelector("h2").textContent = nothing === null
    ? plural(recommended.length, "recommended design") : "No design meets all constraints";
  if (nothing !== null) {
    const nearest = element("button", { type: "button", onclick: () => set({ design: nothing.nearest }) }, `Show the nearest, #${nothing.nearest}`);
    $("nothing").replaceChildren(`${nothing.description[0].toUpperCase()}${nothing.description.slice(1)}. `, nearest);
  }
  $("recommended").replaceChildren(...recommended.map(card));
  drawPictures();
  mark();
}

function card(one) {
  const { design, roles, status, survival, costs } = one;
  const show = () => set({ design });
  const title = roles.map((role, k) => { const name = ROLES[role] ?? role.replaceAll("_", " "); return k ? name.toLowerCase() : name; }).join(", ");
  return element("article", { class: "card", "data-design": design },
    element("button", { type: "button", class: "picture", onclick: show, "aria-label": `Show design ${design}` }, element("img", { alt: "" })),
    element("h3", {}, `${title[0].toUpperCase()}${title.slice(1)}: #${design} ${content.joints(design)}`),
    verdict(status),
    element("dl", { class: "asked" }, ...rows(one).flatMap(([label, value, text]) => [element("dt", {}, label, why(label, text)), element("dd", {}, value)])),
    ...(costs ? [element("p", { class: "note" }, `${costs[0].toUpperCase()}${costs.slice(1)}.`)] : []),
    ...survives(survival),
    ...(one.path ? [element("p", { class: "note" }, `Worst along its cycle: ${one.path}.`)] : []),
    element("p", { class: "buttons" }, element("button", { type: "button", onclick: show }, "Show"),
      ...DOWNLOADS.map(([format, text]) => element("button", { type: "button", onclick: () => downloadOf(design, format) }, text))));
}

const DOWNLOADS = [["urdf", "URDF"], ["mjcf", "MJCF"]];

// What an engineer asks, as far as it is known, and the objectives: label, text, explanation.
function rows({ design, facts }) {
  const { asked, quantities } = content.head;
  const known = asked.filter((name) => name in facts).map((name) => [facts[name].label, facts[name].text, facts[name].description]);
  const others = content.objectives.flatMap((o, k) => (o.name in facts ? [] : [[o.label, quantity(content.values(design)[k], o.unit), quantities[o.name]?.description ?? o.description]]));
  return [...known, ...others];
}

function verdict(status) {
  const passed = status === "verified", failed = status.startsWith("not verified");
  const text = passed ? "Drives its cycle in MuJoCo" : failed ? `Fails in MuJoCo: ${status.slice("not verified: ".length)}` : `Not driven in MuJoCo${status.slice("not simulated".length)}`;
  return element("p", { class: passed ? "passed" : failed ? "missed" : "note" }, text);
}

// Whether the design holds, and the reserve that each perturbation leaves.
function survives(survival) {
  if (survival === null) return [];
  const { holds, verdict, perturbations, assumed } = survival;
  const row = (one) => [element("dt", {}, one.name, why(one.name, one.text)), element("dd", one.holds ? {} : { class: "missed" }, left(one))];
  return [
    element("p", { class: holds ? "passed" : "missed" }, holds ? "Holds" : `${verdict[0].toUpperCase()}${verdict.slice(1)}`),
    element("p", { class: "note" }, "Reserve of the motors, 1 at their limits, and distance from anything:"),
    element("dl", { class: "asked" }, ...perturbations.flatMap(row)),
    ...(assumed ? [element("p", { class: "note" }, `If assumed values are wrong, at worst ${assumed.text}.`)] : []),
  ];
}

function left({ holds, text, reserve, clearance }) {
  const numbers = [reserve?.toFixed(2), clearance === null ? null : millimetres(clearance)];
  return holds ? numbers.filter((one) => one != null).join("; ") || "holds" : text;
}

function drawPictures() {
  for (const one of $("recommended").querySelectorAll(".card")) {
    const picture = snapshot(Number(one.dataset.design));
    one.querySelector(".picture").hidden = picture === null;
    if (picture !== null) one.querySelector("img").src = picture;
  }
}

function mark() {
  markRows($("recommended").querySelectorAll(".card"), "design", state.design);
}

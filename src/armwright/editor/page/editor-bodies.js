// Tool, payload and obstacles.

import { change } from "./editor-document.js";
import { angle, button, formLine, length, list, numberField, record, redraw, removal, set, task, textField, unitName } from "./editor-fields.js";
import { $, element } from "./format.js";

const NEW = {
  box: { kind: "box", center: [0.3, 0.3, 0.05], size: [0.1, 0.1, 0.1] },
  sphere: { kind: "sphere", center: [0.3, 0.3, 0.1], radius: 0.05 },
  cylinder: { kind: "cylinder", center: [0.3, 0.3, 0.1], radius: 0.05, height: 0.2 },
  ground: { kind: "ground", z: 0 },
};

export function drawLoad() {
  const tool = record(task().tool), payload = task().payload, tip = list(tool.tip);
  const fields = [], line = formLine(fields);
  const tipEdit = (k) => (value) => ({ task: [task().tool === undefined
    ? set(["tool"], { tip: [0, 1, 2].map((axis) => (axis === k ? value : 0)) })
    : set(["tool", "tip"], [0, 1, 2].map((axis) => (axis === k ? value : Number(tip[axis] ?? 0))))] });
  line("Tip of the tool", ...[0, 1, 2].map((k) => numberField({ id: `tip-${k}`, value: tip[k] ?? 0, kind: length, label: `${"xyz"[k]} of the tip, from the last link's end`, size: 5, edit: tipEdit(k) })), unitName());
  line("Mass of the tool", numberField({ id: "tool-mass", value: tool.mass ?? 0, label: "Mass of the tool [kg]", size: 5, edit: (value) => ({ task: [set(["tool", "mass"], value)] }) }), "kg");
  if (Array.isArray(payload)) line("Payload", `one for each target, in the file: ${payload.join(", ")} kg`);
  else {
    const path = payload !== null && typeof payload === "object" ? ["payload", "mass"] : ["payload"];
    line("Payload", numberField({ id: "payload", value: record(payload).mass ?? payload ?? 0, label: "Payload [kg]", size: 5, edit: (value) => ({ task: [set(path, value)] }) }), "kg");
  }
  redraw($("load"), ...fields);
}

export function openObstacles() {
  $("obstacle-buttons").replaceChildren(...Object.keys(NEW).map((kind) => button(`Add ${kind}`, () => {
    const known = list(task().obstacles);
    change({ task: [known.length ? set(["obstacles", known.length], NEW[kind]) : set(["obstacles"], [NEW[kind]])] });
  })));
}

export function drawObstacles() {
  const given = list(task().obstacles);
  redraw($("obstacles"), given.length ? element("table", {}, element("tbody", {}, ...given.map(row)))
    : element("p", { class: "note" }, "None. A table or floor is a ground: everything below it is solid."));
}

function row(obstacle, o) {
  const one = record(obstacle), path = ["obstacles", o], kind = one.kind ?? (one.mesh && "mesh");
  const field = (name, keys, value, kind = length) => numberField({ id: `obstacle-${o}-${keys.join("-")}`, value, kind, label: `${name} of obstacle ${o + 1}`, size: 5, edit: (v) => ({ task: [set([...path, ...keys], v)] }) });
  const triple = (name, key) => element("td", {}, `${name} `, ...[0, 1, 2].map((k) => field(`${"xyz"[k]} of the ${name}`, [key, k], list(one[key])[k])));
  const single = (name, key, kind = length) => element("td", {}, `${name} `, field(name, [key], one[key] ?? 0, kind), kind === angle ? " °" : "");
  const cells = {
    box: () => [triple("centre", "center"), triple("size", "size"), ...(one.rpy === undefined ? [single("yaw", "yaw", angle)] : [])],
    sphere: () => [triple("centre", "center"), single("radius", "radius")],
    cylinder: () => [triple("centre", "center"), single("radius", "radius"), single("height", "height")],
    ground: () => [single("solid below z =", "z")],
    mesh: () => [element("td", {}, String(one.mesh))],
  }[kind] ?? (() => []);
  return element("tr", {},
    element("td", {}, String(kind ?? "?")),
    element("td", {}, textField({ id: `obstacle-${o}-name`, value: one.name, label: `Name of obstacle ${o + 1}`, size: 9, edit: (text) => ({ task: [set([...path, "name"], text || null)] }) })),
    element("td", {}, element("span", { class: "row" }, ...cells().flatMap((cell) => [...cell.childNodes]))),
    element("td", {}, removal(`obstacle ${o + 1}`, () => ({ task: [list(task().obstacles).length > 1 ? set(path, null) : set(["obstacles"], null)] }))));
}

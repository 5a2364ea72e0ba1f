// The design space: joints, ranges, tubes and motors.

import { change, opened } from "./editor-document.js";
import { angle, choiceField, formLine, length, list, numberField, numberOf, plainNumber, record, redraw, set, unitName } from "./editor-fields.js";
import { $, element, number, plural } from "./format.js";

const RANGES = [["origin_x", "Base, x", [-1, 1], length], ["origin_y", "Base, y", [-1, 1], length], ["origin_z", "Base, z", [-1, 1], length], ["link", "Link length", [0.03, 0.3], length], ["joint_range", "Joint angle", [-2.4, 2.4], angle]];

const TYPES = ["R", "P", "Y"]; // of a space that states none

let actuators = [], materials = [], modules = [];
const space = () => record(opened.assessed.space);

export function openMotors(choices) {
  ({ actuators, materials, modules } = choices);
  const voltages = [...new Set(actuators.map((one) => one.voltage).filter((v) => v !== null))].sort((a, b) => a - b);
  $("motor-voltage").replaceChildren(element("option", { value: "" }, "any"), ...voltages.map((v) => element("option", { value: v }, `${v} V`)));
  for (const id of ["motor-name", "motor-torque", "motor-price", "motor-voltage"]) $(id).addEventListener("input", drawMotors);
}

export function drawSpace() {
  const fields = [], line = formLine(fields), { joints = 4, link_section: section } = space();
  const [low, high] = Array.isArray(joints) ? joints : [joints, joints];
  const jointsEdit = (a, b) => ({ space: [set(["joints"], a === b ? a : [a, b])] });
  line("Joints",
    numberField({ id: "joints-low", value: low, label: "Least number of joints", size: 3, edit: (v) => jointsEdit(v, Math.max(v, high)) }), "to",
    numberField({ id: "joints-high", value: high, label: "Largest number of joints", size: 3, edit: (v) => jointsEdit(Math.min(low, v), v) }));
  const types = [space().joint_types ?? TYPES].flat();
  line("Joint types", ...modules.map(({ letter, label, description }) => {
    const box = element("input", { type: "checkbox", id: `type-${letter}`, checked: types.includes(letter) });
    box.addEventListener("change", () => {
      const left = types.includes(letter) ? types.filter((one) => one !== letter) : [...types, letter];
      if (left.length) change({ space: [set(["joint_types"], left)] });
      else box.checked = true;
    });
    return element("label", { title: description }, box, ` ${label}`);
  }));
  for (const [key, name, standard, kind] of RANGES) {
    const range = Array.isArray(space()[key]) ? space()[key] : standard;
    line(name, ...[0, 1].flatMap((k) => [k ? "to" : "", numberField({
      id: `space-${key}-${k}`, value: range[k], kind, label: `${name}, ${k ? "largest" : "smallest"}`, size: 6, edit: (v) => ({ space: [set([key], range.map((old, i) => (i === k ? v : Number(old))))] }),
    })]), kind === angle ? "°" : unitName());
  }
  const tubes = list(record(section).tubes), tube = list(tubes[0]);
  const tubeEdit = (k) => (v) => ({ space: [set(["link_section", "tubes"], [[0, 1].map((i) => (i === k ? v : Number(tube[i] ?? [0.03, 0.002][i]))), ...tubes.slice(1)])] });
  line("Tube", numberField({ id: "tube-0", value: tube[0], kind: length, label: "Outer diameter of the tube", size: 5, edit: tubeEdit(0) }), "×",
    numberField({ id: "tube-1", value: tube[1], kind: length, label: "Wall of the tube", size: 4, edit: tubeEdit(1) }), unitName(),
    tubes.length > 1 ? ` and ${plural(tubes.length - 1, "further tube")}, in the file` : "");
  const material = record(section).material;
  if (material === undefined || typeof material === "string") {
    line("Material", choiceField({ id: "material", value: material ?? "", options: [["", "not stated"], ...materials.map((name) => [name, name])], label: "Material of the links", edit: (name) => ({ space: [set(["link_section", "material"], name || null)] }) }));
  } else line("Material", "described in the file");
  line("Safety factor", numberField({ id: "safety", value: space().safety_factor ?? 1.5, kind: plainNumber, label: "Safety factor of the motors' torque", size: 4, edit: (v) => ({ space: [set(["safety_factor"], v)] }) }));
  redraw($("space"), ...fields);
}

const nameOf = (entry) => (typeof entry === "string" ? entry : record(entry).name);

export function drawMotors() {
  const given = list(space().actuators), names = given.map(nameOf);
  const least = numberOf($("motor-torque").value), most = numberOf($("motor-price").value), voltage = $("motor-voltage").value;
  const text = $("motor-name").value.trim().toLowerCase();
  const matches = (one) => !(one.torque < least) && !(one.price > most) && (voltage === "" || String(one.voltage) === voltage)
    && `${one.maker} ${one.name}`.toLowerCase().includes(text);
  const own = given.filter((entry) => !actuators.some((one) => one.name === nameOf(entry))).map(nameOf);
  const shown = actuators.filter((one) => names.includes(one.name) || matches(one));
  shown.sort((a, b) => names.includes(b.name) - names.includes(a.name) || a.torque - b.torque);
  const heads = ["", "motor", "peak torque [N m]", "mass [kg]", "voltage [V]", "price [USD]"];
  redraw($("motors"),
    element("thead", {}, element("tr", {}, ...heads.map((head, k) => element("th", { class: k < 2 ? "text" : "" }, head)))),
    element("tbody", {}, ...shown.map((one) => row(one, given, names))));
  const others = own.length ? `; described in the file: ${own.join(", ")}` : "";
  $("motors-note").textContent = given.length ? `${plural(given.length, "motor")} to choose from${others}.`
    : "None: joints have neither mass nor limits, as in the paper. Choose motors for an arm that can be built.";
}

function row(one, given, names) {
  const isChosen = names.includes(one.name), box = element("input", { type: "checkbox", id: `motor-${one.name}`, "aria-label": one.name, checked: isChosen });
  const toggle = () => {
    const left = isChosen ? given.filter((entry) => nameOf(entry) !== one.name) : [...given, one.name];
    change({ space: [set(["actuators"], left.length ? left : null)] });
  };
  box.addEventListener("change", toggle);
  const values = [one.torque, one.mass, one.voltage, one.price].map((value) => element("td", {}, number(value, 3)));
  const made = element("tr", {}, element("td", { class: "text" }, box), element("td", { class: "text" }, `${one.maker} ${one.name}`.trim()), ...values);
  made.addEventListener("click", (event) => {
    if (event.target !== box) toggle();
  });
  return made;
}

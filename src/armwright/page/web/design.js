// The selected design in numbers, and as files.

import { FIXED, angleOff, chain, distance, length, linkLength } from "./kinematics.js";
import { listen, set, state } from "./state.js";
import { $, element, markRows, metres, millimetres, number, quantity, save } from "./format.js";

const AT_LIMIT = 1e-3; // rad or m
const ONLY_FRONT = "Torques are stated of the designs of the front";
const TYPES = { urdf: "application/xml", mjcf: "application/xml", csv: "text/csv" };
const ENDINGS = { urdf: "urdf", mjcf: "xml", csv: "csv" };

let content = null;

export function openDesign(shownContent) {
  content = shownContent;
  for (const button of document.querySelectorAll(".download")) {
    button.addEventListener("click", () => downloadOf(state.design, button.dataset.format));
  }
  listen((changed) => {
    if (changed.has("design")) drawDesign();
    else if (changed.has("target")) mark();
  });
  drawDesign();
}

// A design at every target: joint values, error [m], angle [rad] (null if none is required), whether it is missed; of a
// design of the front also what holds each joint, and why it misses.
export function postures(i) {
  const arm = content.arm(i), known = content.head.postures[i], { n_angular, rotation, tolerance, angle_tolerance } = content.head;
  return content.targets.map((target, t) => {
    const q = content.q(i, t), posed = chain(arm, q), error = distance(posed.joints.at(-1), target);
    const angle = n_angular[t] ? angleOff(posed.tool, rotation[t].flat(), n_angular[t] === 3) : null;
    const missed = error >= tolerance[t] || (angle ?? 0) >= angle_tolerance[t];
    return { target, q, ...posed, error, angle, missed, ...known?.[t] };
  });
}

// By how much a target is missed, and why if that is known.
export const describeReason = (one) => one.reason ?? describeMiss(one);

function describeMiss(one) {
  return one.angle === null ? millimetres(one.error) : `${millimetres(one.error)}, ${degrees(one.angle)}`;
}

const degrees = (angle) => `${number((180 * angle) / Math.PI, 3)}°`;

// The limit that a joint is at; empty for none.
function at(arm, q, j) {
  if (arm.kind[j] === FIXED) return "";
  if (q[j] >= arm.upper[j] - AT_LIMIT) return "upper";
  return q[j] <= arm.lower[j] + AT_LIMIT ? "lower" : "";
}

function drawDesign() {
  const i = state.design;
  $("design-box").hidden = i === null;
  if (i === null) return;
  const { head } = content, arm = content.arm(i), posed = postures(i), values = content.values(i);
  const n = content.targets.length, found = head.front.includes(i) ? content.verdict(i) : null;
  const verdict = found === null ? "" : `, ${found}`;
  $("design-title").textContent = `#${i} ${content.joints(i)}, ${content.look(i).label}${verdict}`;
  const iteration = head.is_study && i >= content.nInit ? ` Iteration ${i - content.nInit + 1}.` : "";
  const objectives = content.hasFailed(i) ? [`Evaluation failed (${content.failures[i]})`] : content.objectives.map((o, k) => {
    const mean = o.name === "position_error" && n > 1 ? ` summed over ${n} targets (${millimetres(values[k] / n)} on average)` : "";
    return `${o.label} ${evaluated(values[k], o.unit)}${mean}`;
  });
  const feasible = head.constraints.length ? ` ${describeConstraints(i)}` : "";
  const motors = content.chosen(i, "motor").length ? ` Motors: ${content.chosen(i, "motor").join(", ")}.` : "";
  const tube = content.param(i, "tube"), chosenTubes = tube ? [tube] : content.chosen(i, "tube");
  const tubes = chosenTubes.length ? ` Tubes: ${chosenTubes.join(", ")}.` : "";
  const supply = head.cycles[i]?.supply ? ` Supply along the cycle: ${head.cycles[i].supply}.` : "";
  const mount = content.param(i, "mount");
  const onFront = head.front.includes(i) ? "On the Pareto front." : "Not on the Pareto front.";
  const base = Array.from(arm.base, metres).join(", ");
  $("design-summary").textContent = `${objectives.join("; ")}. Base at (${base}) m${mount ? `, ${mount}` : ""}. ${onFront}${describeRecommended(i)}${feasible}${iteration}${motors}${tubes}${supply}${describeIdle(i, posed)}`;
  drawLinks(arm);
  drawPostures(arm, posed);
  const hasFiles = head.files[i] !== undefined;
  for (const button of document.querySelectorAll(".download")) {
    button.disabled = button.dataset.format !== "csv" && !hasFiles;
    button.title = button.disabled ? "Files are available for the designs of the front" : `Download #${i} as ${button.textContent}`;
  }
  const scale = head.torque_scale === null ? "" : ` The torque objective is ${head.torque_scale} times their norm, summed.`;
  const loads = head.payloads.some((kg) => kg > 0) ? ` Payload at the targets: ${[...new Set(head.payloads)].join(", ")} kg.` : "";
  const solids = head.obstacles.length ? ` Obstacles: ${head.obstacles.map((solid) => solid.description).join("; ")}.` : "";
  const boxes = head.workspace.length ? ` Workspace: ${head.workspace.map((box) => box.description).join("; ")}.` : "";
  const lines = head.cycle ? ` Cycle: ${head.cycle}.` : "";
  const cases = head.cases ? ` Objectives are the worst of the nominal task and ${head.cases}; everything else is of the nominal task.` : "";
  const ignored = head.ignored_errors ? ` In this task, ${head.ignored_errors}.` : "";
  const sheet = ` Data sheet: armwright datasheet ${head.folder} --design ${i}`;
  $("design-note").textContent = `Angles q in rad${arm.kind.includes(1) ? ", strokes of prismatic joints in m" : ""}; underlined: at a joint's limit. Torques hold the posture against gravity.${scale}${cases}${ignored}${loads} ${head.masses}.${describeAssumed(i)}${solids}${lines}${boxes}${sheet}`;
}

const evaluated = (value, unit) => Number.isFinite(value) ? quantity(value, unit) : "not evaluated";

// Describes the quantities that constraints bound.
function describeConstraints(i) {
  const violations = content.violations(i);
  const values = content.head.constraints.map((c, k) => {
    const has = c.bound + c.sign * c.scale * violations[k];
    return `${c.description}: ${evaluated(has, c.unit)}${violations[k] > 0 ? " (violated)" : ""}`;
  });
  return `${content.isFeasible(i) ? "Feasible" : "Infeasible"}; ${values.join("; ")}.`;
}

// Says for what it is recommended, whether it is verified, and which perturbations it survives.
function describeRecommended(i) {
  const found = content.head.recommended.find((one) => one.design === i);
  if (!found) return "";
  const { status, survival, roles } = found;
  return ` Recommended (${roles.join(", ")}): ${status}; ${survival?.verdict ?? "perturbations not evaluated"}.`;
}

// Names the values of its motors that are assumed.
function describeAssumed(i) {
  const { assumed } = content.head, chosen = content.chosen(i, "motor");
  const motors = Object.keys(assumed).filter((motor) => !chosen.length || chosen.includes(motor));
  const names = (motor) => Object.keys(assumed[motor]).join(", ").replaceAll("_", " ");
  const byNames = new Map(motors.map((motor) => [names(motor), motors.filter((other) => names(other) === names(motor))]));
  return [...byNames].map(([list, which]) => ` Assumed of ${which.join(", ")}: ${list}.`).join("");
}

function drawLinks(arm) {
  const { joint } = content.head.colours;
  $("links").replaceChildren(...Array.from(arm.axis, (axis, j) => {
    const long = linkLength(arm, j);
    const moves = [`rotates about ${"xyz"[axis]}`, `slides along ${"xyz"[axis]}`, "fixed"][arm.kind[j]];
    const word = content.joints(state.design), letter = word.length === arm.axis.length ? word[j] : ["RPY"[axis], "slide", "F"][arm.kind[j]];
    const bar = element("div", { title: `Link ${j + 1}: ${millimetres(long)}, after joint ${j + 1} (${moves} at first)` },
      `${letter} ${millimetres(long)}`);
    bar.style.flex = `${1e6 * Math.max(long, 1e-6)} 1 0`;
    bar.style.background = arm.kind[j] === FIXED ? content.head.colours.infeasible : joint["xyz"[axis]];
    return bar;
  }));
}

function drawPostures(arm, posed) {
  const joints = [...arm.axis.keys()];
  const head = element("tr", {}, ...["", "target [m]", "missed by", "largest torque [N m]"].map((name, k) =>
    element("th", { scope: "col", class: k === 1 ? "text" : "" }, name)),
  ...joints.map((j) => element("th", { scope: "col", title: `limits ${number(arm.lower[j], 3)} to ${number(arm.upper[j], 3)}` },
    arm.kind[j] === 1 ? `q${j + 1} [m]` : `q${j + 1}`)));
  const rows = posed.map((one, t) => element("tr", {
    "data-target": t, tabindex: "0", onclick: () => set({ target: t }),
    onkeydown: (event) => {
      if (event.key === "Enter" || event.key === " ") {
        set({ target: t });
        event.preventDefault();
      }
    },
  },
  element("td", {}, String(t + 1)),
  element("td", { class: "text" }, one.target.map((v) => number(v, 3)).join(", ")),
  element("td", { class: one.missed ? "missed" : "", title: one.missed ? describeReason(one) : null }, one.missed ? describeMiss(one) : "reached"),
  element("td", { title: one.torques?.map((v, j) => `joint ${j + 1}: ${number(v, 3)} N m`).join("\n") ?? ONLY_FRONT }, describeLargest(one.torques)),
  ...joints.map((j) => {
    const side = at(arm, one.q, j);
    return element("td", {}, element("span", { class: side ? "limit" : "", title: side ? `at its ${side} limit` : null }, one.q[j].toFixed(3).replace(/^-(?=[0.]+$)/, "")));
  })));
  const limits = element("tr", {}, element("td", { class: "text", colspan: "4" }, "limits"),
    ...joints.map((j) => element("td", {}, arm.kind[j] === FIXED ? "–" : `${number(arm.lower[j], 3)}…${number(arm.upper[j], 3)}`)));
  $("postures").replaceChildren(element("thead", {}, head), element("tbody", {}, ...rows), element("tfoot", {}, limits));
  mark();
}

function describeLargest(torques) {
  if (!torques) return "–";
  const largest = torques.reduce((best, v, j) => (Math.abs(v) > Math.abs(torques[best]) ? j : best), 0);
  return `${number(Math.abs(torques[largest]), 3)} (joint ${largest + 1})`;
}

// Names the joints that the task does not need.
function describeIdle(i, posed) {
  const ways = [...posed.map((one) => one.q), ...(content.head.cycles[i]?.q ?? []).flat()], { kind } = content.arm(i);
  const idle = [...posed[0].q.keys()].filter((j) => kind[j] < 2 && ways.every((q) => Math.abs(q[j] - ways[0][j]) < AT_LIMIT));
  if (!idle.length || ways.length < 2) return "";
  return ` ${idle.length === 1 ? `Joint ${idle[0] + 1} never moves` : `Joints ${idle.map((j) => j + 1).join(", ")} never move`}.`;
}

function mark() {
  showRow(markRows($("postures").querySelectorAll("tbody tr"), "target", state.target));
}

// Scrolls a table's own box to a row, if there is one, never the page.
export function showRow(row) {
  if (row === null) return;
  const box = row.closest(".scroll"), head = box.querySelector("thead").offsetHeight;
  const foot = box.querySelector("tfoot")?.offsetHeight ?? 0, end = row.offsetTop + row.offsetHeight + foot;
  if (row.offsetTop - head < box.scrollTop) box.scrollTop = row.offsetTop - head;
  else if (end > box.scrollTop + box.clientHeight) box.scrollTop = end - box.clientHeight;
}

// Saves a design as a file.
export function downloadOf(i, format) {
  const name = `${content.head.config.task.name}-${i}.${ENDINGS[format]}`;
  save(name, format === "csv" ? asCsv(i) : content.head.files[i][format], TYPES[format]);
}

function asCsv(i) {
  const arm = content.arm(i), joints = [...arm.axis.keys()].map((j) => j + 1);
  const { is_oriented } = content.head, posed = postures(i), hasTorques = Boolean(posed[0].torques);
  const head = ["target", "x", "y", "z", "position_error", ...(is_oriented ? ["angle_error"] : []), ...(hasTorques ? ["torque_norm"] : []),
    ...joints.map((j) => `q_${j}`), ...(hasTorques ? joints.map((j) => `torque_${j}`) : [])];
  const rows = posed.map((one, t) => [t + 1, ...one.target, one.error, ...(is_oriented ? [one.angle ?? ""] : []),
    ...(hasTorques ? [length(one.torques)] : []), ...one.q, ...(one.torques ?? [])]);
  return [head, ...rows].map((row) => row.join(",")).join("\n") + "\n";
}

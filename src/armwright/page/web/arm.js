// The selected arm in space, in one posture for each target.

import { during } from "./cycle.js";
import { describeReason, postures } from "./design.js";
import { FIXED, PRISMATIC, chain, columnBody, length, motorBody, rail } from "./kinematics.js";
import { drawTask, faint, glass, solid } from "./scene.js";
import { ball, empty, floorParts, rod, segments } from "./shapes.js";
import { solidParts } from "./solids.js";
import { openStage } from "./stage.js";
import { listen, set, state } from "./state.js";
import { $, colour, dot, element, number, onTheme, shown } from "./format.js";

const REST = 1200; // [ms] at a target while playing
const VIEW = [0.55, -1, 0.42]; // initial direction of the camera
const PICTURE = [480, 320], BORDER = 0.12, CLOSEST = 2; // [px] of snapshots, what they leave free, and their largest zoom
const FILLS = 0.8; // an arm smaller than this share of the frame's radius gets a new frame
const SLACK = 0.2; // share of the frame's radius by which an arm may leave it before it grows

const GROUPS = ["floor", "obstacles", "around", "targets", "ghost", "compared", "arm"];
const [HIT, NOW] = ["#009E73", "#E69F00"]; // colours of targets

let content = null;
let stage = null, groups = {}; // null without 3D graphics
let materials = {};
let playing = false;
let began = null; // time [ms] at which the played cycle began; null while not moving along one
let onTheWay = false; // whether the arm moves along the cycle, so that it is at no target

export function openArm(shownContent) {
  content = shownContent;
  $("arm-box").hidden = false;
  $("previous").addEventListener("click", () => step(-1));
  $("next").addEventListener("click", () => step(1));
  $("play").addEventListener("click", () => play(!playing));
  $("ghost").addEventListener("change", drawArm);
  $("compare").addEventListener("click", () => set({ compared: state.compared === null ? state.design : null }));
  addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, table, .plot") || event.altKey || event.ctrlKey || event.metaKey) return;
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      step(event.key === "ArrowLeft" ? -1 : 1);
      event.preventDefault();
    }
  });
  legend();
  stage = openStage($("arm"), GROUPS, VIEW, drawArm, "Everything else on this page works without.");
  for (const id of ["ghost", "play"]) $(id).disabled = !stage;
  if (stage) {
    ({ groups } = stage);
    paint();
    onTheme(() => { paint(); stage.frame = null; drawArm(); });
  }
  listen((changed) => {
    const isDriven = began !== null;
    if (changed.has("design") || changed.has("compared") || (changed.has("target") && !isDriven)) drawArm();
    if (changed.has("design") && playing && (isDriven || during(content.head, state.design, 0) !== null)) play(true);
    if (changed.size) describeTarget();
  });
  drawArm();
  describeTarget();
}

// Returns a picture of a design as a data address; null without 3D graphics.
export function snapshot(design) {
  if (!stage) return null;
  const { renderer, camera, controls } = stage, kept = { ...state }, keptFrame = stage.frame;
  const way = camera.position.clone(), [width, height] = PICTURE;
  Object.assign(state, { design, compared: null, target: 0 });
  stage.frame = null;
  renderer.setPixelRatio(1);
  renderer.setSize(width, height, false);
  camera.aspect = width / height;
  drawArm();
  const widest = Math.max(...extent().map((point) => new THREE.Vector3(...point).project(camera)).flatMap(({ x, y }) => [Math.abs(x), Math.abs(y)]));
  camera.zoom = Math.min(CLOSEST, (1 - BORDER) / widest);
  camera.updateProjectionMatrix();
  stage.render();
  const picture = stage.canvas.toDataURL();
  camera.zoom = 1;
  Object.assign(state, kept);
  stage.frame = null;
  stage.fit();
  drawArm();
  if (keptFrame !== null && stage.turned) {
    camera.position.copy(way);
    controls.update();
    stage.render();
  }
  return picture;
}

// Returns the corners in the world of each drawn part of a kind, such as "joint"; for tests.
export function drawn(kind) {
  const parts = kind === "obstacle" ? groups.obstacles.children : groups.arm.children.filter((mesh) => mesh.userData.kind === kind);
  return parts.map((part) => {
    part.updateMatrixWorld();
    const { array, count } = part.geometry.attributes.position;
    return Array.from({ length: count }, (_, k) => new THREE.Vector3().fromArray(array, 3 * k).applyMatrix4(part.matrixWorld).toArray());
  });
}

function paint() {
  const { joint, target, missed } = content.head.colours;
  materials = {
    link: solid(colour("arm")), base: solid(shown("#111111")), joints: ["x", "y", "z"].map((axis) => solid(joint[axis])),
    motors: ["x", "y", "z"].map((axis) => glass(joint[axis])),
    ghost: faint(colour("arm"), 0.2), compared: faint(target, 0.45), comparedMotor: glass(target, 0.2),
    reached: solid(HIT), missed: solid(missed), now: solid(NOW),
    column: glass(colour("arm")),
    gap: new THREE.LineDashedMaterial({ color: missed, dashSize: 0.02, gapSize: 0.012 }),
  };
}

// Draws the legend; letters as in the names of designs.
function legend() {
  const { joint } = content.head.colours, labels = content.head.joint_labels;
  const parts = [...["x", "y", "z"].map((axis) => [joint[axis], labels[axis]]),
    [NOW, "current target"], [HIT, "reached"], [content.head.colours.missed, "missed"]];
  if (content.obstacles.length) parts.push([content.head.colours.obstacle, "obstacle"]);
  const ofTask = [...(content.head.bodies.length ? ["tool, payload"] : []), ...(content.head.lines.length ? ["lines"] : []), "compared design"];
  parts.push([content.head.colours.target, ofTask.join(", ")]);
  if (content.head.workspace.length) parts.push([colour("soft"), "workspace (edges)"]);
  $("arm-legend").replaceChildren(...parts.map(([paint_, text]) => element("span", { class: "key" }, dot(paint_), text)));
}

// Returns the points of the selected design that must be visible: targets, and the arm in all postures.
function extent() {
  const points = [...content.targets, ...content.head.workspace.flatMap(({ low, high }) => [low, high])];
  for (const i of new Set([state.design, state.compared ?? state.design])) {
    const arm = content.arm(i), column = columnBody(arm);
    content.targets.forEach((_, t) => points.push(...chain(arm, content.q(i, t)).joints));
    if (column) points.push([arm.base[0], arm.base[1], column.centre[2] - column.half[2]]);
  }
  return points;
}

// Fits the frame to the design; an existing frame stays unless the arm leaves it.
function reframe() {
  if (!stage.reframe(extent(), 1e-3, SLACK, FILLS)) return;
  const { joint, target, obstacle } = content.head.colours;
  drawFloor();
  drawTask(groups, content.head, stage.frame, { obstacle, target, axes: ["x", "y", "z"].map((axis) => joint[axis]) });
  empty(groups.targets);
  for (const place of content.targets) groups.targets.add(ball(place, ballSize(), materials.missed));
  stage.look();
}

function drawFloor() {
  empty(groups.floor);
  const { parts, cell, isSeen } = floorParts(stage.frame);
  groups.floor.add(...parts);
  const where = isSeen ? "the axes are at the world's origin" : "the axes are at the grid's corner, not at the world's origin";
  $("arm-note").textContent = `Grid of ${number(cell)} m; ${where}; z is up. Drag to rotate; use the wheel or two fingers to zoom, and the arrow keys to step through the targets.`;
}

const ballSize = () => 0.028 * stage.frame.radius;

// Links have their own thickness, limited so that they stay visible and hide nothing.
const thick = (arm, j) => Math.min(Math.max(arm.radius[j], 0.008 * stage.frame.radius), 0.035 * stage.frame.radius);

function drawPosture(group, arm, q, paints) {
  empty(group);
  const posed = chain(arm, q), { joints, ends, axes } = posed;
  for (let j = 0; j < q.length; j++) {
    const radius = thick(arm, j), wide = 1.45 * radius;
    group.add(rod(joints[j], ends[j], radius, paints.link));
    if (arm.kind[j] === PRISMATIC) group.add(rod(...rail(arm, posed, q, j), 0.5 * radius, paints.base));
    const along = axes[j].map((v) => v * 1.25 * wide);
    const joint = rod(joints[j].map((v, k) => v - along[k]), joints[j].map((v, k) => v + along[k]), wide, arm.kind[j] === FIXED ? paints.link : paints.joints[arm.axis[j]]);
    joint.userData.kind = "joint";
    joint.position.set(...joints[j]);
    group.add(joint);
    const body = motorBody(arm, posed, j);
    if (body) {
      const [mesh, ...edges] = solidParts(body, stage.frame, paints.motors[arm.axis[j]]);
      mesh.userData.kind = "motor";
      group.add(mesh, ...edges);
    }
  }
  const column = columnBody(arm);
  if (column) {
    const [mesh, ...edges] = solidParts(column, stage.frame, paints.column);
    mesh.userData.kind = "column";
    group.add(mesh, ...edges);
  }
  const radius = thick(arm, 0);
  const behind = (way) => Array.from(arm.base, (v, k) => v - way * arm.up[k]); // end of the base plate
  group.add(rod(behind(2.05 * radius), behind(1.15 * radius), 2.4 * radius, paints.base));
  if (length(arm.tip) > 0) group.add(rod(ends.at(-1), joints.at(-1), 0.6 * radius, paints.base));
  const tip = ball(joints.at(-1), 1.15 * radius, paints.link);
  tip.userData.kind = "joint";
  group.add(tip);
  return joints.at(-1);
}

export function drawArm() {
  if (!stage || state.design === null) return;
  reframe();
  const arm = content.arm(state.design), posed = postures(state.design);
  const tip = drawPosture(groups.arm, arm, content.q(state.design, state.target), materials);
  gap(tip);
  paintTargets(posed);
  empty(groups.ghost);
  if ($("ghost").checked) {
    posed.forEach((one, t) => {
      if (t === state.target) return;
      for (let j = 0; j < one.q.length; j++) {
        groups.ghost.add(rod(one.joints[j], one.ends[j], 0.55 * thick(arm, j), materials.ghost));
      }
    });
  }
  empty(groups.compared);
  if (state.compared !== null && state.compared !== state.design) {
    const pale = { link: materials.compared, joints: [0, 1, 2].map(() => materials.compared), base: materials.compared, motors: [0, 1, 2].map(() => materials.comparedMotor), column: materials.comparedMotor };
    drawPosture(groups.compared, content.arm(state.compared), content.q(state.compared, state.target), pale);
  }
  stage.render();
}

function paintTargets(posed = postures(state.design)) {
  groups.targets.children.forEach((mesh, t) => {
    mesh.material = t === state.target ? materials.now : posed[t].missed ? materials.missed : materials.reached;
    mesh.scale.setScalar((t === state.target ? 1.6 : 1) * ballSize());
  });
}

// Draws the line from the tip to a missed target.
function gap(tip) {
  const target = content.targets[state.target];
  const line = segments([...tip, ...target], materials.gap);
  line.computeLineDistances();
  groups.arm.add(line);
}

function step(by) {
  if (state.design === null) return;
  if (began !== null) play(false);
  const n = content.targets.length;
  set({ target: (state.target + by + n) % n });
}

let beat = null;

function play(on) {
  playing = on;
  clearInterval(beat);
  beat = began = null;
  if (onTheWay) {
    onTheWay = false;
    describeTarget();
  }
  $("play").setAttribute("aria-pressed", on);
  $("play").textContent = on ? "Stop" : "Play";
  if (!on) drawArm();
  else if (during(content.head, state.design, 0) !== null && !matchMedia("(prefers-reduced-motion: reduce)").matches) {
    began = performance.now();
    requestAnimationFrame(drive);
  } else {
    beat = setInterval(() => step(1), REST);
    step(1);
  }
}

// Draws the arm on its way through the cycle, in real time.
function drive(now) {
  if (began === null) return;
  const at = during(content.head, state.design, Math.max(0, now - began) / 1000);
  if (at === null) { // it has left the front
    play(true);
    return;
  }
  const changed = at.moves !== onTheWay;
  onTheWay = at.moves;
  set({ target: at.target });
  if (changed) describeTarget();
  empty(groups.ghost);
  drawPosture(groups.arm, content.arm(state.design), at.q, materials);
  paintTargets();
  stage.render();
  requestAnimationFrame(drive);
}

function describeTarget() {
  const i = state.design;
  if (i === null) return;
  const one = postures(i)[state.target], n = content.targets.length;
  $("arm-title").textContent = `#${i} ${content.joints(i)}`;
  const verdict = one.missed ? `missed by ${describeReason(one)}` : "reached", which = `${state.target + 1} of ${n}`;
  $("target-note").textContent = onTheWay ? `To target ${which}` : `Target ${which}: ${verdict}`;
  $("target-note").className = one.missed ? "missed" : "";
  $("compare").setAttribute("aria-pressed", state.compared !== null);
  $("compare").textContent = state.compared === null ? "Compare" : `Beside #${state.compared} ✕`;
}

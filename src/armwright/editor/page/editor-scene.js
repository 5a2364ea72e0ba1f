// The task in space. Targets can be dragged: along the ground, or with Shift upwards and downwards.

import { change, opened } from "./editor-document.js";
import { $, number, onTheme } from "./format.js";
import { choose, chosen, listenToChoice, placeEdit } from "./editor-targets.js";
import { drawTask, solid, thin } from "./scene.js";
import { ball, boxEdges, empty, floorParts, letters, segments } from "./shapes.js";
import { openStage } from "./stage.js";

const VIEW = [0.55, -1, 0.55]; // initial direction of the camera
const BALL = 0.025, LETTER = 0.09; // as shares of the frame's radius
const GRIP = 1.6; // times the radius of a ball, within which it is grabbed
const GRID = 0.001; // [m] to which dragged targets are rounded
const MOST_NAMED = 60; // targets with their names
const GROUPS = ["floor", "bases", "obstacles", "around", "targets", "names"];
const [TARGET, NOW, OBSTACLE, BASE] = ["#CC79A7", "#E69F00", "#6E7F91", "#0072B2"];

let stage = null, groups = {}; // null without 3D graphics
let drawn = null; // the scene of the server that is shown
let dragged = null; // { index, up, normal, place, from, mesh, moved }

export function openScene() {
  stage = openStage($("scene"), GROUPS, VIEW, drawScene, "The tables below do the same.", listenToPointer);
  if (!stage) return;
  ({ groups } = stage);
  listenToChoice(paintChoice);
  onTheme(drawScene);
}

// Returns where the targets are drawn, on the canvas [px]; for tests.
export function targetPlaces() {
  const { left, top, width, height } = stage.canvas.getBoundingClientRect();
  return groups.targets.children.map((mesh) => {
    const place = mesh.position.clone().project(stage.camera);
    return [left + ((place.x + 1) / 2) * width, top + ((1 - place.y) / 2) * height];
  });
}

// Before the controls, which would turn the view.
function listenToPointer(canvas) {
  canvas.addEventListener("pointerdown", grab, { capture: true });
  canvas.addEventListener("pointermove", drag);
  canvas.addEventListener("pointerup", drop);
  canvas.addEventListener("pointercancel", drop);
}

// Draws what the server reads in the files; while a file is not valid, the last scene stays.
export function drawScene() {
  if (!stage || dragged !== null) return;
  drawn = opened.assessed?.scene ?? drawn;
  if (drawn === null) {
    $("scene-note").textContent = "The scene appears as soon as the task file is valid.";
    return;
  }
  const points = [...drawn.targets, ...(drawn.bases ?? []), ...drawn.workspace.flatMap(({ low, high }) => [low, high])];
  if (stage.reframe(points, 1e-2, 0.4, 0.5)) stage.look();
  $("scene-note").textContent = opened.assessed.scene === null ? "The task file is not valid; this is how it was before." : describe();
  const { frame } = stage, { radius } = frame;
  for (const group of Object.values(groups)) empty(group);
  groups.floor.add(...floorParts(frame).parts);
  drawTask(groups, drawn, frame, { obstacle: OBSTACLE, target: TARGET, axes: [TARGET, TARGET, TARGET] });
  if (drawn.bases) {
    groups.bases.add(segments(boxEdges(...drawn.bases), thin(BASE)));
    groups.bases.add(letters("base", drawn.bases[1], LETTER * radius, "left"));
  }
  drawn.targets.forEach((target, t) => {
    groups.targets.add(ball(target, BALL * radius, solid(TARGET)));
    if (t < MOST_NAMED) groups.names.add(letters(drawn.names[t], target, LETTER * radius, "left"));
  });
  paintChoice();
}

function describe() {
  const bases = drawn.bases ? "; the blue box holds the allowed bases" : "";
  return `Grid of ${number(floorParts(stage.frame).cell)} m; z is up${bases}. Drag a target along the ground, with Shift up and down; drag elsewhere to rotate.`;
}

function paintChoice() {
  if (!stage || stage.frame === null) return;
  groups.targets.children.forEach((mesh, t) => {
    mesh.material.color.set(t === chosen() ? NOW : TARGET);
    mesh.scale.setScalar((t === chosen() ? 1.5 : 1) * BALL * stage.frame.radius);
  });
  stage.render();
}

// Returns the line of sight through a point of the canvas: { from, way }.
function sight(event) {
  const { canvas, camera } = stage, box = canvas.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * 2 - 1, y = 1 - ((event.clientY - box.top) / box.height) * 2;
  return { from: camera.position, way: new THREE.Vector3(x, y, 0.5).unproject(camera).sub(camera.position).normalize() };
}

// Returns where a line of sight meets the plane through a point; null if it does not.
function meet({ from, way }, normal, place) {
  const far = normal.dot(place.clone().sub(from)) / normal.dot(way);
  return far > 0 && Number.isFinite(far) ? from.clone().addScaledVector(way, far) : null;
}

// Returns the index of the nearest target on a line of sight; -1 for none.
function hit({ from, way }) {
  const far = groups.targets.children.map((mesh) => {
    const along = mesh.position.clone().sub(from), depth = along.dot(way);
    return along.addScaledVector(way, -depth).length() < GRIP * mesh.scale.x ? depth : Infinity;
  });
  const nearest = Math.min(...far);
  return nearest < Infinity ? far.indexOf(nearest) : -1;
}

function grab(event) {
  if (event.button !== 0 || stage.frame === null) return;
  const line = sight(event), index = hit(line);
  if (index < 0) return;
  event.stopImmediatePropagation();
  event.preventDefault();
  const mesh = groups.targets.children[index], place = mesh.position.clone(), up = event.shiftKey, normal = new THREE.Vector3(0, 0, 1);
  choose(index);
  if (up) normal.copy(line.way).setZ(0).normalize();
  dragged = { index, up, normal, place, from: meet(line, normal, place), mesh, moved: false };
  stage.canvas.setPointerCapture(event.pointerId);
}

function drag(event) {
  if (dragged === null) return;
  const { normal, from, place, mesh, up } = dragged, at = meet(sight(event), normal, place);
  if (at === null || from === null) return;
  const shift = at.sub(from), round = (v) => Math.round(v / GRID) * GRID;
  if (up) mesh.position.setZ(round(place.z + shift.z));
  else mesh.position.set(round(place.x + shift.x), round(place.y + shift.y), place.z);
  dragged.moved = true;
  const [x, y, z] = mesh.position.toArray().map((v) => number(v, 6));
  $("scene-note").textContent = `Target ${drawn.names[dragged.index]} at (${x}, ${y}, ${z}) m`;
  stage.render();
}

function drop() {
  if (dragged === null) return;
  const { index, mesh, moved } = dragged;
  dragged = null;
  if (moved) change({ task: placeEdit(index, mesh.position.toArray()) });
}

// The task in space, as the page of a run and the editor draw it.

import { colour } from "./format.js";
import { arrow, boxEdges, empty, segments } from "./shapes.js";
import { solidParts } from "./solids.js";

const ARROW = 0.15, THIN = 0.006; // length and thickness of arrows, as shares of the frame's radius

export const solid = (paint) => new THREE.MeshLambertMaterial({ color: paint });
export const faint = (paint, opacity) => new THREE.MeshLambertMaterial({ color: paint, transparent: true, opacity, depthWrite: false });
export const thin = (paint) => new THREE.LineBasicMaterial({ color: paint });
export const glass = (paint, opacity = 0.3) => ({ face: faint(paint, opacity), edge: thin(paint) });

// Draws obstacles and, around the targets, tool and payload, lines of the cycle, the edges of the boxes to cover, and the
// tool directions: an arrow along z, and for a full orientation also along x and y. paints: { obstacle, target, axes }.
export function drawTask({ obstacles, around }, task, frame, paints) {
  for (const group of [obstacles, around]) empty(group);
  for (const one of task.obstacles) obstacles.add(...solidParts(one, frame, glass(paints.obstacle)));
  for (const body of task.bodies) around.add(...solidParts(body, frame, glass(paints.target, 0.2)));
  if (task.lines.length) around.add(segments(task.lines.flat(2), thin(paints.target)));
  for (const { low, high } of task.workspace) around.add(segments(boxEdges(low, high), thin(colour("soft"))));
  task.targets.forEach((target, t) => {
    const isWhole = task.n_angular[t] === 3;
    for (const k of isWhole ? [0, 1, 2] : task.n_angular[t] ? [2] : []) {
      const way = task.rotation[t].map((row) => row[k]), long = (k === 2 ? 1 : 0.6) * ARROW * frame.radius;
      around.add(...arrow(target, way, long, THIN * frame.radius, solid(isWhole ? paints.axes[k] : paints.target)));
    }
  });
}

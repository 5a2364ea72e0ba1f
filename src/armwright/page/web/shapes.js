// Parts of a 3D scene: balls, rods, arrows, lines, letters, and a floor with axes.

import { colour } from "./format.js";

const CELLS = [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 50, 100]; // [m] possible sides of the grid's cells
const MOST_CELLS = 16; // most cells along one side of the grid
const NECK = 0.72; // where the head of an arrow begins, as a share of its length

// Unit shapes, shared by all parts.
let unit = null;

function shape(name) {
  unit ??= { rod: new THREE.CylinderGeometry(1, 1, 1, 20), cone: new THREE.CylinderGeometry(0, 1, 1, 20), ball: new THREE.SphereGeometry(1, 20, 14) };
  return unit[name];
}

// Removes all parts of a group, and frees their memory.
export function empty(group) {
  for (const { geometry } of group.children) if (!Object.values(unit ?? {}).includes(geometry)) geometry?.dispose();
  group.clear();
}

export function ball(place, radius, material) {
  const mesh = new THREE.Mesh(shape("ball"), material);
  mesh.position.set(...place);
  mesh.scale.setScalar(radius);
  return mesh;
}

// Returns a cylinder between two points.
export function rod(from, to, radius, material) {
  const [a, b] = [new THREE.Vector3(...from), new THREE.Vector3(...to)], way = b.clone().sub(a);
  const mesh = new THREE.Mesh(shape("rod"), material);
  mesh.scale.set(radius, Math.max(way.length(), 1e-6), radius);
  mesh.position.copy(a.add(b).multiplyScalar(0.5));
  if (way.length() > 0) mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.normalize());
  return mesh;
}

// Returns the parts of an arrow from a point along a unit vector.
export function arrow(from, way, long, thickness, material) {
  const [end, neck] = [1, NECK].map((share) => from.map((v, k) => v + share * long * way[k]));
  const head = rod(neck, end, 3.3 * thickness, material);
  head.geometry = shape("cone");
  return [rod(from, end, thickness, material), head];
}

export function segments(points, material) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  return new THREE.LineSegments(geometry, material);
}

// Returns the ends of the twelve edges of a box along the axes.
export function boxEdges(low, high) {
  return [0, 1, 2].flatMap((axis) => [0, 1, 2, 3].flatMap((corner) => {
    const others = [0, 1, 2].filter((k) => k !== axis), [start, end] = [[...low], [...low]];
    others.forEach((k, bit) => { start[k] = end[k] = corner >> bit & 1 ? high[k] : low[k]; });
    end[axis] = high[axis];
    return [...start, ...end];
  }));
}

// Returns text that faces the camera; size: its height in the scene.
export function letters(text, place, size, align = "center") {
  const canvas = document.createElement("canvas"), high = 64;
  const font = "44px system-ui, sans-serif";
  const brush = canvas.getContext("2d");
  canvas.height = high; // resets the font, as the width does
  brush.font = font;
  canvas.width = Math.max(high, Math.ceil(brush.measureText(text).width) + 8);
  Object.assign(brush, { font, textAlign: "center", textBaseline: "middle", fillStyle: colour("soft") });
  brush.fillText(text, canvas.width / 2, high / 2);
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), transparent: true, depthTest: false }));
  sprite.position.set(...place);
  sprite.scale.set((size * canvas.width) / high, size, 1);
  if (align === "left") sprite.center.set(-0.15, 0.5);
  return sprite;
}

// Returns a grid below the frame { low, high, radius } and axes: at the world's origin if that is seen, else at a corner.
export function floorParts({ low, high, radius }) {
  const span = Math.max(high[0] - low[0], high[1] - low[1], 0.5 * radius);
  const cell = CELLS.find((size) => span / size <= MOST_CELLS) ?? 100;
  const [x0, x1, y0, y1] = [low[0], high[0], low[1], high[1]].map((v, k) => (k % 2 ? Math.ceil(v / cell) : Math.floor(v / cell)) * cell);
  const z = low[2] - 0.02 * radius, points = [];
  for (let x = x0; x <= x1 + cell / 2; x += cell) points.push(x, y0, z, x, y1, z);
  for (let y = y0; y <= y1 + cell / 2; y += cell) points.push(x0, y, z, x1, y, z);
  const parts = [segments(points, new THREE.LineBasicMaterial({ color: colour("line") }))];
  const isSeen = [0, 1, 2].every((k) => low[k] - radius / 2 <= 0 && high[k] + radius / 2 >= 0);
  const corner = isSeen ? [0, 0, 0] : [x0, y0, z];
  for (const [k, axis] of ["x", "y", "z"].entries()) {
    const [end, place] = [[...corner], [...corner]];
    end[k] += 0.3 * radius;
    place[k] += 0.37 * radius;
    parts.push(segments([...corner, ...end], new THREE.LineBasicMaterial({ color: colour("soft") })), letters(axis, place, 0.13 * radius));
  }
  return { parts, cell, isSeen };
}

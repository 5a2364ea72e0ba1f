// Obstacles: translucent, with the edges of boxes and the rims of cylinders.

import { segments } from "./shapes.js";

const RIM = 48; // points of a circle

// Transforms a point from the obstacle's frame to the world.
function placed({ centre, rotation }, p) {
  return [0, 1, 2].map((r) => centre[r] + rotation[r][0] * p[0] + rotation[r][1] * p[1] + rotation[r][2] * p[2]);
}

// A box is a four-sided prism with unit sides, scaled.
const prism = () => new THREE.CylinderGeometry(Math.SQRT1_2, Math.SQRT1_2, 1, 4, 1, false, Math.PI / 4);

// Returns the meshes and lines of an obstacle; the ground is a plate below the visible frame { centre, radius }.
export function solidParts(solid, frame, { face, edge }) {
  const { shape, half, rotation, centre } = solid;
  if (shape === "ground") {
    const [x, y] = frame.centre, r = 1.5 * frame.radius, thick = 0.01 * frame.radius;
    const mesh = new THREE.Mesh(prism(), face);
    mesh.scale.set(2 * r, thick, 2 * r);
    mesh.rotation.set(Math.PI / 2, 0, 0);
    mesh.position.set(x, y, centre[2] - thick / 2);
    const corners = [[x - r, y - r], [x + r, y - r], [x + r, y + r], [x - r, y + r]].map((p) => [...p, centre[2]]);
    return [mesh, segments(corners.flatMap((p, k) => [p, corners[(k + 1) % 4]]).flat(), edge)];
  }
  if (shape === "mesh") {
    const corners = solid.hull.flat().flatMap((p) => placed(solid, p)), geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
    geometry.computeVertexNormals();
    return [new THREE.Mesh(geometry, Object.assign(face.clone(), { side: 2 }))]; // its triangles face in or out
  }
  const geometry = shape === "sphere" ? new THREE.SphereGeometry(1, 32, 20)
    : shape === "box" ? prism() : new THREE.CylinderGeometry(1, 1, 1, RIM);
  // Shapes of three.js are upright along y, obstacles along z: swap the axes.
  const mesh = new THREE.Mesh(geometry, face);
  const [a, b, c] = half, wide = shape === "box" ? 2 : 1, high = shape === "sphere" ? 1 : 2;
  const columns = [0, 1, 2].map((k) => [0, 1, 2].map((r) => rotation[r][k]));
  const [x, y, z] = [columns[0].map((v) => v * wide * a), columns[2].map((v) => v * high * c), columns[1].map((v) => -v * wide * b)];
  mesh.matrixAutoUpdate = false;
  mesh.matrix.set(x[0], y[0], z[0], centre[0], x[1], y[1], z[1], centre[1], x[2], y[2], z[2], centre[2], 0, 0, 0, 1);
  return [mesh, ...outline(solid, edge)];
}

function outline(solid, edge) {
  const [a, b, c] = solid.half, points = [];
  if (solid.shape === "box") {
    for (const s of [-1, 1]) {
      for (const t of [-1, 1]) {
        points.push([-a, s * b, t * c], [a, s * b, t * c], [s * a, -b, t * c], [s * a, b, t * c], [s * a, t * b, -c], [s * a, t * b, c]);
      }
    }
  } else if (solid.shape === "cylinder") {
    const at = (k, z) => [a * Math.cos((2 * Math.PI * k) / RIM), a * Math.sin((2 * Math.PI * k) / RIM), z];
    for (let k = 0; k < RIM; k++) points.push(at(k, -c), at(k + 1, -c), at(k, c), at(k + 1, c));
  }
  return points.length ? [segments(points.flatMap((p) => placed(solid, p)), edge)] : [];
}

// Where the parts of an arm are in a posture.

const REVOLUTE = 0;
export const PRISMATIC = 1;
export const FIXED = 2;

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const at = (array, i) => [array[3 * i], array[3 * i + 1], array[3 * i + 2]];
const column = (m, k) => [m[k], m[3 + k], m[6 + k]];
const turned = (m, v) => [0, 3, 6].map((r) => m[r] * v[0] + m[r + 1] * v[1] + m[r + 2] * v[2]);

// Rotates m (3 x 3 by rows) about its own axis k by an angle [rad].
function rotated(m, k, angle) {
  const [i, j] = [(k + 1) % 3, (k + 2) % 3], [s, c] = [Math.sin(angle), Math.cos(angle)];
  const out = m.slice();
  for (const r of [0, 3, 6]) {
    out[r + i] = m[r + i] * c + m[r + j] * s;
    out[r + j] = m[r + j] * c - m[r + i] * s;
  }
  return out;
}

// joints: positions of the joints and, last, of the tip [m]; ends: of the links; axes: of the joints, in the world;
// mounts: frame of the link before each joint, and the joint at displacement 0; tool: its own x, y and z in the world.
export function chain(arm, q) {
  let frame = [1, 0, 0, 0, 1, 0, 0, 0, 1], place = Array.from(arm.base);
  const joints = [], ends = [], axes = [], mounts = [];
  for (let j = 0; j < q.length; j++) {
    const axis = column(frame, arm.axis[j]);
    axes.push(axis);
    mounts.push([frame, place]);
    if (arm.kind[j] === PRISMATIC) place = add(place, axis.map((v) => v * q[j]));
    joints.push(place);
    if (arm.kind[j] === REVOLUTE) frame = rotated(frame, arm.axis[j], q[j]);
    place = add(place, turned(frame, at(arm.offset, j)));
    ends.push(place);
  }
  const [x, z] = [turned(frame, arm.tool_side), turned(frame, arm.tool_axis)];
  return { joints: [...joints, add(place, turned(frame, arm.tip))], ends, axes, mounts, tool: [x, cross(z, x), z] };
}

// Returns the ends of a prismatic joint's rail in a posture.
export function rail(arm, posed, q, j) {
  const along = (way) => posed.joints[j].map((v, k) => v + posed.axes[j][k] * (way - q[j]));
  return [along(arm.lower[j]), along(arm.upper[j])];
}

const SHAPES = ["box", "sphere", "cylinder"];

// Returns the motor body of a joint as a solid in the world; null without one.
export function motorBody(arm, posed, j) {
  const shape = arm.body_shape && SHAPES[arm.body_shape[j]];
  if (!shape) return null;
  const [frame, place] = posed.mounts[j], k = arm.axis[j];
  const columns = [(k + 1) % 3, (k + 2) % 3, k].map((c) => column(frame, c));
  const rotation = [0, 1, 2].map((r) => columns.map((c) => c[r]));
  return { shape, half: at(arm.body_half, j), rotation, centre: add(place, turned(frame, at(arm.body_centre, j))) };
}

// Returns the column below the base as a solid in the world; null without one.
export function columnBody(arm) {
  const half = arm.column_half && at(arm.column_half, 0);
  if (!half || half[2] === 0) return null;
  return { shape: "cylinder", half, rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], centre: [arm.base[0], arm.base[1], arm.base[2] - half[2]] };
}

// Returns the angle [rad] between a tool and a target's frame (3 x 3 by rows): of its z alone, or of all its axes.
export function angleOff(tool, frame, isWhole) {
  const goal = [0, 1, 2].map((k) => column(frame, k));
  if (!isWhole) return Math.atan2(length(cross(tool[2], goal[2])), dot(tool[2], goal[2]));
  const skew = tool.map((axis, k) => cross(axis, goal[k])).reduce(add); // 2 sin(angle) times the axis of rotation
  return Math.atan2(length(skew), tool.reduce((sum, axis, k) => sum + dot(axis, goal[k]), -1));
}

export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
export const length = (v) => Math.hypot(...v);
export const linkLength = (arm, j) => length(at(arm.offset, j));

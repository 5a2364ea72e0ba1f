// The content of the page: unpacked from the bytes of a run.

const VIEWS = {
  uint8: Uint8Array, int32: Int32Array, int64: BigInt64Array, float32: Float32Array, float64: Float64Array,
};

const OF_ARM = ["base", "up", "tip", "tool_axis", "tool_side", "column_half"];
const OF_JOINTS = ["motion", "lower", "upper", "offset", "radius", "body_shape", "body_half", "body_centre"];

// A JSON head, and arrays that are views of the bytes (see page/content.py, pack).
function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  for (const [name, [type, at, shape]] of Object.entries(head.arrays)) {
    const size = shape.reduce((product, n) => product * n, 1);
    arrays[name] = { data: new VIEWS[type](buffer, 4 + length + at, size), shape };
  }
  return { head, arrays };
}

// The bytes of a page that opens without a server.
export async function embedded(text) {
  const binary = atob(text.trim());
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

export class Content {
  constructor() {
    this.head = null;
    this.n = 0;
    this.calls = [];
    this.proposals = {};
    this.failures = {}; // why evaluations failed, which then have no finite values
  }

  // Takes a packed run in place of what was there.
  load(buffer) {
    const { head, arrays } = unpack(buffer);
    this.head = head;
    this._arrays = arrays;
    this.curve = arrays.curve.data;
    ({ n: this.n, proposals: this.proposals, failures: this.failures, calls: this.calls } = head);
  }

  // A view of the part of an array that belongs to a design.
  _part(name, i) {
    const { data, shape } = this._arrays[name], size = data.length / shape[0];
    return data.subarray(i * size, (i + 1) * size);
  }

  get objectives() { return this.head.config.objectives; }
  get nInit() { return this.head.config.method.n_init ?? 0; }
  get targets() { return this.head.targets; }
  get obstacles() { return this.head.obstacles; }
  source(i) { return this.head.sources[this._part("source", i)[0]]; }
  look(i) { return this.head.looks[this.source(i)]; } // by name, of what JSON.parse made: no name is special
  values(i) { return this._part("values", i); }
  violations(i) { return this._part("violations", i); } // one per constraint; satisfied at <= 0; NaN: not evaluated
  hasFailed(i) { return i in this.failures; }
  isEvaluated(i) { return this.values(i).every(Number.isFinite); } // all objectives are known
  isFeasible(i) { return !this.hasFailed(i) && this.violations(i).every((value) => value <= 0); }

  // The active parameters: the arm has their module, and its type uses them.
  params(i) {
    const numbers = this._part("params", i), known = {};
    return this.head.parameters.map((p, k) => ({ ...p, value: p.choices ? p.choices[numbers[k]] : numbers[k] })).filter((p) => {
      if (p.needs) {
        const [module, types] = p.needs;
        if (module > Number(known.n_joints ?? module)) return false;
        if (p.name !== `joint_${module}` && !types.includes(known[`joint_${module}`])) return false;
      }
      known[p.name] = p.value;
      return true;
    });
  }

  // The joint types in order, such as "PYR".
  joints(i) { return this.chosen(i, "joint").join(""); }

  // The value of a parameter; undefined if it is not active.
  param(i, name) { return this.params(i).find((p) => p.name === name)?.value; }

  // The choices of KIND_1, KIND_2, … in order; KIND is "joint", "motor", "tube" or "direction".
  chosen(i, kind) {
    return this.params(i).filter((p) => p.choices && p.name.startsWith(`${kind}_`)).map((p) => p.value);
  }

  // What is drawn of a design: `kind` (kinematics.js) and `axis` of each joint, and its parts of these arrays.
  arm(i) {
    const arrays = this._arrays, [, room] = arrays.motion.shape, n = this._part("joints", i)[0], arm = {};
    for (const name of OF_ARM) if (name in arrays) arm[name] = this._part(name, i);
    for (const name of OF_JOINTS) {
      if (!(name in arrays)) continue;
      const part = this._part(name, i);
      arm[name] = part.subarray(0, (n * part.length) / room);
    }
    arm.kind = Array.from(arm.motion, (motion) => Math.floor(motion / 4));
    arm.axis = Array.from(arm.motion, (motion) => motion % 4);
    return arm;
  }

  // Joint values [rad] or [m] at a target.
  q(i, target) {
    const all = this._part("q", i), size = all.length / this.targets.length;
    return all.subarray(target * size, target * size + this._part("joints", i)[0]);
  }

  // Whether a design of the front is found good, and the word for it; null without a verification.
  isGood(i) { return this.head.result.verdict?.numbers.includes(i) ?? null; }
  verdict(i) { const { verdict } = this.head.result; return verdict && (verdict.numbers.includes(i) ? verdict.good : verdict.bad); }
  callsOf(i) {
    const id = this.proposals[i]?.id;
    return id ? this.calls.filter((call) => isOf(call, id)) : [];
  }

  // What was predicted of the designs of a call that were not evaluated.
  screenedOf(call) {
    return Object.values(this.proposals).filter((one) => one.screened && isOf(call, one.id)).map((one) => one.screened);
  }
}

// Several designs of one call are named NAME-0042.1, .2, …
function isOf(call, id) {
  return call.proposal && (call.proposal === id || id.startsWith(call.proposal + "."));
}

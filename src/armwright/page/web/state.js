// The selection of the user, and its listeners.

const listeners = [];

export const state = {
  design: null, // number of the selected design
  compared: null, // number of the design that stays visible for comparison
  target: 0,
  iteration: null, // last iteration in the Pareto plot; null: all
};

export function listen(listener) {
  listeners.push(listener);
}

export function set(change) {
  const before = { ...state };
  Object.assign(state, change);
  const changed = new Set(Object.keys(change).filter((key) => state[key] !== before[key]));
  if (changed.size) for (const listener of listeners) listener(changed);
}

// The address holds the selection: #design=42&target=3, targets counted from 1.
export function fromAddress(content) {
  const query = new URLSearchParams(location.hash.slice(1)), found = {};
  const design = Number.parseInt(query.get("design"), 10), target = Number.parseInt(query.get("target"), 10);
  if (design >= 0 && design < content.n) found.design = design;
  if (target >= 1 && target <= content.targets.length) found.target = target - 1;
  return found;
}

export function keepAddress() {
  listen((changed) => {
    if ((changed.has("design") || changed.has("target")) && state.design !== null) {
      history.replaceState(null, "", `#design=${state.design}&target=${state.target + 1}`);
    }
  });
}

// The way of a design through the cycle of its task, in time.

const PAUSE = 1; // [s] after the end of an open cycle, before it begins again

// Returns where a design is at a time [s] after the cycle began: its joint values, the target that it moves to or rests
// at, the step, and whether it moves. Returns null for a design whose way is not known.
export function during(head, design, time) {
  const cycle = head.cycles[design];
  if (cycle === undefined) return null;
  const rests = head.motions.map((motion) => motion.rest);
  if (!head.is_closed) rests[rests.length - 1] += PAUSE;
  let left = time % cycle.seconds.reduce((sum, seconds, m) => sum + seconds + rests[m], 0);
  for (const [m, { target, step }] of head.motions.entries()) {
    const share = Math.min(1, left / cycle.seconds[m]);
    if (left < cycle.seconds[m] + rests[m]) return { q: between(cycle.q[m], profile(share)), target, step, moves: share < 1 };
    left -= cycle.seconds[m] + rests[m];
  }
  return { q: cycle.q.at(-1).at(-1), target: head.motions.at(-1).target, step: head.motions.at(-1).step, moves: false };
}

// From rest to rest (docs/method.md, section 17).
const profile = (t) => t ** 3 * (10 - 15 * t + 6 * t * t);

// Interpolates between points at equal shares.
function between(points, share) {
  const at = share * (points.length - 1), before = Math.min(Math.floor(at), points.length - 2);
  return points[before].map((v, j) => v + (at - before) * (points[before + 1][j] - v));
}

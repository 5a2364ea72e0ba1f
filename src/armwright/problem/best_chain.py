"""The chain of postures on which an arm serves a task best.

The chain of least estimated cost is loaded first. An arm that violates a constraint on it is also loaded on the
cheapest chain of the first three candidates of each block, if it differs and is not blocked, and the lesser violation
counts. The order of candidates does not depend on their number: no design is lost that three of them make feasible.
"""

from collections.abc import Callable, Sequence

import numpy as np

from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.cycle.cycle_choice import choose_postures
from armwright.kinematics.cycle.line_following import IndexArray
from armwright.kinematics.devices import Device
from armwright.pareto import total_violation
from armwright.problem.constraints import Constraint
from armwright.problem.evaluation import Evaluation, evaluate_arrays
from armwright.problem.outcomes import Outcomes
from armwright.problem.scene import Scene

FEWER = 3  # candidates of each block, among which the shortest chains are often the least loaded ones
SAME = 1e-3  # [rad] or [m] between postures of one chain


def best_chain(
    arms: ArmArrays,
    scene: Scene,
    constraints: Sequence[Constraint],
    judge: Callable[[Evaluation, IndexArray], Outcomes],
    device: Device,
) -> tuple[Evaluation, Outcomes]:
    """Return the physics of N arms on the chain of least estimated cost, and the outcomes of the best chain of each.

    judge: returns the outcomes of some arms (n,) from their physics.
    """
    first = evaluate_arrays(arms, scene, device)
    best = judge(first, np.arange(len(arms)))
    paths = first.cycle_paths
    if paths is None or paths.candidates is None or paths.blocked is None:
        return first, best
    few = paths.candidates[:, :, :FEWER]
    # Without other candidates the choice is the same, and a chain that is not blocked is the cheapest of fewer as well.
    is_same = (few == paths.entry[:, :, None]).all(axis=3).any(axis=2).all(axis=1) & ~paths.blocked
    is_same |= np.isnan(paths.candidates[:, :, FEWER:]).all(axis=(1, 2, 3))
    own = ((), ("masses",))  # needs of quantities that are fixed by the design alone
    is_fixed = [one.quantity.over == "arm" and one.quantity.needs in own for one in constraints]
    is_open = np.ones(len(arms), dtype=bool) if paths.branches is None else (paths.branches > 0).all(axis=1)
    violated = best.violations > 0.0
    rows = np.flatnonzero(is_open & violated.any(axis=1) & ~violated[:, is_fixed].any(axis=1) & ~is_same)
    if not len(rows):
        return first, best
    payload = float(scene.payload.max())
    chosen = choose_postures(first.arms[rows], paths.plan, few[rows], scene.obstacles, device, payload)
    is_new = (np.abs(chosen.candidate - paths.entry[rows]).max(axis=(1, 2)) > SAME) & ~chosen.blocked
    if not is_new.any():
        return first, best
    rows, entry = rows[is_new], chosen.candidate[is_new]
    other = judge(evaluate_arrays(arms[rows], scene, device, candidates=entry[:, :, None]), rows)
    better = total_violation(other.violations) < total_violation(best.violations[rows])
    return first, best.replaced(rows[better], other, better) if better.any() else best

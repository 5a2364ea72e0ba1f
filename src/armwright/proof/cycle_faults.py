"""Where along its cycle a design is worst, and a via point for a step that collides."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.forward import forward_kinematics, jacobian_of
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.cycle.cycle_path import CyclePaths
from armwright.kinematics.cycle.motion_path import MotionPath
from armwright.kinematics.ik.ik import solve_postures
from armwright.problem.evaluation import CYCLE_GAP, Evaluation
from armwright.tasks.motions import CyclePlan
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.targets import REACHED

VIA_DISTANCES = (0.05, 0.1, 0.2, 0.3)  # [m] of a via point from the tip where a step collides
NEGLIGIBLE = 1e-3  # [mm], [°] of an error in texts
VIA_SHARES = np.linspace(0.0, 1.0, 17)  # of the joint motions to and from a via point, at which it is checked

# Label and unit of each extreme in texts, and the number of these units in a metre, radian or cubic metre.
_SHOWN: Mapping[str, tuple[str, str, float]] = {
    "path_error": ("path error", " mm", 1e3),
    "path_angle": ("angle error", "°", math.degrees(1.0)),
    "clearance": ("clearance", " mm", 1e3),
    "limit_distance": ("distance to joint limits", "°", math.degrees(1.0)),  # of revolute joints
    "slide_distance": ("distance to the ends of slides", " mm", 1e3),
    "manipulability": ("manipulability", " m³", 1.0),
}


@dataclass(frozen=True)
class Extreme:
    """The worst value of a quantity along a cycle."""

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(allow_inf_nan=False)

    value: float  # the value [m], [rad] or [m³]
    step: int  # the number of the step, from 1
    motion: str  # which of the step's motions it is, such as "line in"; empty if the step has only one
    share: float  # the share of this motion at which it occurs, 0 to 1

    @property
    def place(self) -> str:
        """The step, the motion and the share on one line."""
        return f"{_place(self.step, self.motion)}, at {100.0 * self.share:.0f} %"


def path_extremes(paths: CyclePaths, row: int) -> dict[str, Extreme]:
    """Return where an arm is worst along its cycle, by name of the quantity.

    Errors are left out if the cycle has no lines, and the clearance if there is nothing to hit.
    """
    arm, of_motions = paths.of_arm(row)
    found: dict[str, Extreme] = {}
    lines = [i for i, path in enumerate(of_motions) if path.motion.by == "line"]
    if lines:
        found["path_error"] = _extreme(paths.plan, paths.path_error[row], paths.worst[row, :, 0])
    if any(paths.plan.poses.n_angular[of_motions[i].motion.end] for i in lines):
        found["path_angle"] = _extreme(paths.plan, paths.path_angle[row], paths.worst[row, :, 1])
    clearance = np.minimum(paths.self_clearance[row], paths.obstacle_clearance[row])
    if np.isfinite(clearance).any():
        found["clearance"] = _extreme(paths.plan, clearance, paths.worst[row, :, 2], smallest=True)
    distances = [arm.limit_distances(path.q)[0] for path in of_motions]
    measured = {
        "limit_distance": [np.where(arm.prismatic, np.inf, each).min(axis=1) for each in distances],
        "slide_distance": [np.where(arm.prismatic, each, np.inf).min(axis=1) for each in distances],
        "manipulability": [_manipulabilities(arm, path.q) for path in of_motions],
    }
    for name, values in measured.items():
        least = np.array([one.min() for one in values])
        shares = np.array([one.argmin() / (len(one) - 1) for one in values])
        if np.isfinite(least).any():
            found[name] = _extreme(paths.plan, least, shares, smallest=True)
    return found


def jumping_steps(paths: CyclePaths, row: int) -> list[int]:
    """Return the numbers of the steps in which the joints of an arm cannot move continuously."""
    return sorted({paths.plan.motions[i].step + 1 for i in np.flatnonzero(paths.jumps[row])})


def path_record(evaluation: Evaluation, row: int) -> dict[str, Any]:
    """Return `path` for JSON: where an arm is worst along its cycle, and where it jumps; empty without a cycle."""
    paths = evaluation.cycle_paths
    if paths is None:
        return {}
    extremes = {name: asdict(extreme) for name, extreme in path_extremes(paths, row).items()}
    return {"path": {**extremes, "jumps": jumping_steps(paths, row)}}


def describe_path(path: Mapping[str, Extreme | list[int]] | None) -> str:
    """Describe on one line where an arm is worst along its cycle, from `path` of its record; empty without one."""
    found = ((name, (path or {}).get(name)) for name in _SHOWN)
    return "; ".join(_describe(name, extreme) for name, extreme in found if isinstance(extreme, Extreme))


def describe_faults(evaluation: Evaluation, row: int) -> str:
    """Describe where an arm fails to follow its cycle, with a via point for a collision; empty without faults."""
    paths = evaluation.cycle_paths
    if paths is None:
        return ""
    extremes, allowed = path_extremes(paths, row), paths.plan.cycle.tolerance
    faults = [f"jump in step {step}" for step in jumping_steps(paths, row)]
    for name, bound in (("path_error", allowed.largest_distance), ("path_angle", allowed.largest_angle)):
        if name in extremes and extremes[name].value > bound:
            faults.append(_describe(name, extremes[name]))
    clearance = extremes.get("clearance")
    if clearance is not None and clearance.value < CYCLE_GAP:
        via, depth = _avoid(paths, row, evaluation.obstacles), -1e3 * clearance.value
        where = f"collision, {depth:.3g} mm deep" if depth > 0.0 else f"only {-depth:.2g} mm apart"
        faults.append(f"{where} ({clearance.place}): {via}")
    return "; ".join(faults)


def via_point(
    arm: ArmArrays, plan: CyclePlan, path: MotionPath, share: float, obstacles: Sequence[Obstacle]
) -> Array | None:
    """Return a point through which one arm avoids a collision at a share of a motion, None if none was found.

    Points to all sides of the tip are tried. The arm must reach the point, and be free along the joint motions from the
    start of the motion to the point and from there to its end. The point with the largest clearance is returned.
    """
    q = path.at(np.array([0.0, share, 1.0]))  # (1, 3, D)
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    shifts = np.array(VIA_DISTANCES)[:, None, None] * sides  # (distances, 6, 3)
    points = forward_kinematics(arm, q).tip[0, 1] + shifts.reshape(-1, 3)
    found = solve_postures(arm, points, initial_q=q[:, 1:2], precision=arm.precision)
    via = found.q.astype(np.float64)[0, :, None]  # (P, 1, D)
    start, end, along = q[0, 0], q[0, 2], VIA_SHARES[:, None]
    ways = np.concatenate([start + along * (via - start), via + along * (end - via)], axis=1)  # (P, 34, D)
    ways = ways.reshape(1, -1, arm.dof)
    # What is allowed at the ends of the motion, is allowed all the way.
    rules = plan.rules(replace(path.motion, by="line"), np.zeros(ways.shape[1]))
    clearance = np.minimum(*clearances(arm, ways, obstacles, rules=rules)).reshape(len(points), -1)
    reached = found.distance(points)[0] < REACHED
    least = np.where(reached, clearance.min(axis=1), -np.inf)
    return points[least.argmax()] if least.max() > 0.0 else None


def _avoid(paths: CyclePaths, row: int, obstacles: Sequence[Obstacle]) -> str:
    """Propose a via point for the motion in which an arm collides most."""
    clearance = np.minimum(paths.self_clearance[row], paths.obstacle_clearance[row])
    worst = int(clearance.argmin())
    arm, of_motions = paths.of_arm(row)
    point = via_point(arm, paths.plan, of_motions[worst], float(paths.worst[row, worst, 2]), obstacles)
    if point is None:
        return "try a via point, a target on a way around it"
    return f"try a via point, a target at {[round(float(c), 3) for c in point]} m, through which this arm moves freely"


def motion_place(plan: CyclePlan, index: int) -> str:
    """Return the step of a motion, and which of its motions it is: `step 3, line in`."""
    return _place(plan.motions[index].step + 1, _part(plan, index))


def _place(step: int, part: str) -> str:
    return f"step {step}{', ' if part else ''}{part}"


def _extreme(plan: CyclePlan, values: Array, shares: Array, smallest: bool = False) -> Extreme:
    """Return the largest or smallest of (M,) values of motions, with its share of the motion."""
    worst = int(values.argmin() if smallest else values.argmax())
    return Extreme(float(values[worst]), plan.motions[worst].step + 1, _part(plan, worst), float(shares[worst]))


def _part(plan: CyclePlan, index: int) -> str:
    """Return which part of its step a motion is; empty for the only one."""
    own = [i for i, motion in enumerate(plan.motions) if motion.step == plan.motions[index].step]
    if len(own) == 1:
        return ""
    if plan.motions[index].by == "joint":
        return "joint motion"
    return "line out" if index == own[0] else "line in"


def _manipulabilities(arm: ArmArrays, q: Array) -> Array:
    """Return the (R,) manipulability sqrt(det J Jᵀ) of the position Jacobian [m³]; q: (1, R, D)."""
    jacobian = jacobian_of(arm, forward_kinematics(arm, q))[0]
    return np.sqrt(np.maximum(np.linalg.det(jacobian @ jacobian.swapaxes(-1, -2)), 0.0))


def _describe(name: str, extreme: Extreme) -> str:
    label, unit, factor = _SHOWN[name]
    value = factor * extreme.value
    shown = (
        f"below {NEGLIGIBLE:g}" if 0.0 < value < NEGLIGIBLE and name in ("path_error", "path_angle") else f"{value:.3g}"
    )
    return f"{label} {shown}{unit} ({extreme.place})"

"""What more candidates are worth: how many random designs of cycles have a feasible path with 4, 8 and 16 of them.

Candidates are postures at the first pose of each block of lines, each from another start of the inverse kinematics. A
path is feasible if it stays within the tolerances, does not jump and does not collide; drives do not count.

    python benchmarks/candidates.py
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.cycle_path import find_paths
from armwright.kinematics.line_following import tool_errors
from armwright.spaces.batch_builder import stack_designs
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task

N = 512
CANDIDATES = (1, 4, 8, 16)
DOWN = [0, 0, -1]
BINS = [[0.3, 0.0, 0.1], [0.15, 0.3, 0.15], [-0.1, 0.3, 0.1], [0.25, -0.25, 0.2]]
ACTIONS = ["pick", "place", None, None]
BOX = {"kind": "box", "center": [0.3, 0.2, 0.08], "size": [0.06, 0.06, 0.16]}
GROUND = {"kind": "ground", "z": -0.01}


def task(kind: str, **cycle: Any) -> Task:
    """Return a task that picks, places and passes two more points, the last one by a line."""
    direction = {"point": {}, "axis": {"axis": DOWN}, "orientation": {"orientation": [np.pi, 0.0, 0.0]}}[kind]
    targets = [{"position": point, **direction} for point in BINS]
    by = ["joint", "joint", "joint", "line"]
    steps = [{"to": n, "do": do, "by": how} for n, (do, how) in enumerate(zip(ACTIONS, by, strict=True), start=1)]
    content = {"name": kind, "targets": targets, "tool": {"tip": [0.0, 0.0, 0.05]}, "obstacles": [BOX, GROUND]}
    return Task.model_validate({**content, "cycle": {"steps": steps, "time": 1.5, **cycle}})


def space(letters: str) -> DesignSpace:
    """Return arms of these joints."""
    return DesignSpace.model_validate(
        {
            "name": letters.lower(),
            "joints": len(letters),
            "restrict": {f"joint_{j}": letter for j, letter in enumerate(letters, start=1)},
            "link": [0.05, 0.25],
            "joint_range": [-3.1, 3.1],
            "origin_x": [-0.1, 0.1],
            "origin_y": [-0.1, 0.1],
            "origin_z": [0.0, 0.1],
        }
    )


WORK: Mapping[str, tuple[Task, DesignSpace]] = {
    "4 joints, points": (task("point"), space("YPPP")),
    "5 joints, tool down": (task("axis", approach=0.05), space("YPPPP")),
    "6 joints, tool down": (task("axis", approach=0.05), space("YPPPYR")),
    "6 joints, orientation": (task("orientation", approach=0.05), space("YPPYPY")),
}


def feasible(cell: Task, designs: DesignSpace, candidates: int) -> Array:
    """Return (N,) True for designs with a feasible path."""
    arms = stack_designs(designs, designs.matrix(designs.sample(N, seed=0)), cell.tool)
    paths = find_paths(arms, cell.plan(cell.target_positions), cell.obstacles, candidates)
    allowed = paths.plan.cycle.tolerance
    good = (paths.path_error <= allowed.largest_distance) & (paths.path_angle <= allowed.largest_angle) & ~paths.jumps
    good &= np.minimum(paths.self_clearance, paths.obstacle_clearance) >= 0.0
    reached = good.all(axis=1)
    poses = paths.plan.poses[[motion.end for motion in paths.plan.motions]]
    for group in paths.groups:
        q = np.stack([path.q[:, -1] for path in group.paths], axis=1)
        errors = tool_errors(group.arms, poses, q)
        within = (errors[..., 0] < poses.tolerance) & (errors[..., 1] < poses.angle_tolerance)
        reached[group.index] &= within.all(axis=1)
    return reached


def main() -> None:
    print(f"Designs with a feasible path, of {N} random ones; gained and lost against 4 candidates")
    for name, (cell, designs) in WORK.items():
        found = {k: feasible(cell, designs, k) for k in CANDIDATES}
        base = found[4]
        parts = [f"{k}: {found[k].sum()} (+{(found[k] & ~base).sum()}, -{(base & ~found[k]).sum()})" for k in found]
        print(f"  {name:24} {', '.join(parts)}")


if __name__ == "__main__":
    main()

"""Arms with one joint fewer: a joint that never leaves 0 along the task is removed.

At 0, a joint does not change any frame, so the links before and after it act as one. If both have the same direction,
they become one link, the sum of both; the link of the first joint becomes a part of the base position. Values beyond
their ranges become the nearest allowed ones: the arm is no longer the same, but may serve as well. If the space does
not allow this, the joint becomes a fixed module, if the space has one. Of a module of two joints, the other one stays.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import DesignError
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import DIRECTIONS, MODULES, mounted_vector
from armwright.spaces.parameters import Design, FloatParameter, ParameterValue

IDLE = 1e-3  # [rad]; a joint that stays nearer to 0 along the task is removed
KINDS = ("joint", "link", "direction", "tube", "motor", "stroke", "limit")  # parameters of a module


def reduced(problem: Problem, matrix: Array) -> Array:
    """Return (K, P) designs without joints that never move, all different; K = 0 if nothing can be removed.

    For each of (N, P) designs and each of its modules with such joints, there is the design without these. A joint that
    turns is idle if it stays within 1e-3 rad of 0 at all targets, along the whole cycle and in every case of the task.
    The inverse kinematics may choose other postures for the reduced arm, which has to be evaluated.
    """
    if not len(matrix):
        return matrix
    designs = problem.space.designs(matrix)
    found: dict[Design, None] = {}  # in order, each once
    for design, idle in zip(designs, idle_joints(problem, matrix), strict=True):
        found |= dict.fromkeys(without_joints(problem.space, design, idle))
    return problem.space.matrix(list(found)).reshape(-1, len(problem.space.parameters))


def idle_joints(problem: Problem, matrix: Array) -> NDArray[np.bool_]:
    """Return (N, J) which joints of N designs stay within 1e-3 rad (m for a slide) of 0 along the whole task."""
    largest = [
        np.max([_largest(problem, matrix[rows], case) for case in range(len(problem.scenes))], axis=0)
        for rows in problem.chunks(len(matrix))
    ]
    return np.concatenate(largest) <= IDLE


def _largest(problem: Problem, matrix: Array, case: int) -> Array:
    """Return (N, J) the largest distance of each joint from 0 at the targets and along the cycle of one case."""
    evaluation = problem.physics(matrix, case)
    largest = np.abs(evaluation.q).max(axis=1)
    if evaluation.cycle_paths is not None:
        for group in evaluation.cycle_paths.groups:
            along = np.max([np.abs(path.q).max(axis=1) for path in group.paths], axis=0)
            largest[group.index] = np.maximum(largest[group.index], along)
    return largest


def without_joints(space: DesignSpace, design: Design, idle: NDArray[np.bool_]) -> Iterator[Design]:
    """Yield a design without the idle joints of each of its modules in turn, as far as the space allows it."""
    joints = np.array(design.module_of_joint)
    for i, module in enumerate(design.modules):
        moving = tuple(
            joint for joint, still in zip(module.joints, idle[: len(joints)][joints == i], strict=True) if not still
        )
        if not module.is_revolute or moving == module.joints:
            continue
        kept = [letter for letter, other in MODULES.items() if other.joints == moving] or ["F"]
        options = [{**design.params, f"joint_{i + 1}": kept[0]}]
        for params in options if moving else [_merged(space, design, i), *options]:
            try:
                yield space.design(params)
            except DesignError:  # outside the space
                continue
            break


def _merged(space: DesignSpace, design: Design, i: int) -> dict[str, ParameterValue]:
    """Return the values of a design whose module `i` is gone and whose link before it also spans the one after it.

    It has the tube of the link before. Where the two links have different directions there is no such link: the values
    then lack the one before.
    """
    count = len(design.modules)
    kinds = (*KINDS, *(name for name, custom in space.custom if custom.per is not None))
    columns = {kind: [design.params.get(f"{kind}_{j}") for j in range(1, count + 1)] for kind in kinds}
    base, links, directions = list(design.origin), list(design.links), columns["direction"]
    if i == 0:
        first = DIRECTIONS[directions[0] or space.link_directions[0]]  # pyright: ignore[reportArgumentType]
        base = [b + links[0] * c for b, c in zip(base, mounted_vector(first, space.mount_of(design)), strict=True)]
    else:
        columns["link"][i - 1] = links[i - 1] + links[i] if directions[i - 1] == directions[i] else None
    numbered = {
        f"{kind}_{j}": value
        for kind, values in columns.items()
        for j, value in enumerate(values[:i] + values[i + 1 :], start=1)
        if value is not None
    }
    names = {f"{kind}_{j}" for kind in kinds for j in range(1, count + 1)}
    arm = {name: value for name, value in design.params.items() if name not in names}
    arm |= {f"origin_{axis}": value for axis, value in zip("xyz", base, strict=True)}
    merged = {**arm, **numbered, "n_joints": str(count - 1)}
    ranges = {p.name: p for p in space.parameters if isinstance(p, FloatParameter)}
    return merged | {name: ranges[name].nearest(float(value)) for name, value in merged.items() if name in ranges}

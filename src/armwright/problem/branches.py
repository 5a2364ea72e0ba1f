"""Which branch of the inverse kinematics a design takes through its cycle, and the best way that it gives up.

That is the way of least estimated cost which takes another branch at one pose at least. It is evaluated in full.
"""

from dataclasses import dataclass, replace

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.cycle.cycle_choice import choose_postures
from armwright.kinematics.cycle.entry_postures import entry_postures
from armwright.problem.best_chain import SAME
from armwright.problem.constraints import describe_violated
from armwright.problem.evaluation import Evaluation
from armwright.problem.problem import Problem
from armwright.tasks.motions import CyclePlan

MOST = 2  # violations that are named, the largest first


@dataclass(frozen=True)
class Branches:
    """The branches of a design at the first pose of each block of its cycle, after a joint motion."""

    steps: list[int]  # number of the step in which the arm gets there
    found: list[int]  # number of branches that follow the lines from there
    taken: list[list[float]]  # joint values of the one that is taken [rad] or [m]
    other: list[list[float]] | None = None  # those of the best other way; None without one
    why: str = ""  # where it differs, and what it violates or costs; empty without one

    def __str__(self) -> str:
        counts = [f"{count} in step {step}" for step, count in sorted(zip(self.steps, self.found, strict=True))]
        return f"branches where joint motions end: {', '.join(counts)}{f'; {self.why}' if self.why else ''}"


def branches_of(problem: Problem, matrix: Array, entry: Array | None) -> list[Branches]:
    """Return the branches of N designs (N, P) in the first case of the task; empty without a cycle.

    entry: (N, C, B, D) postures that they take (`Outcomes`); None to choose them.
    """
    scene = problem.scenes[0]
    if scene.plan is None:
        return []
    evaluation = problem.physics(matrix, entry=entry)
    candidates = entry_postures(evaluation.arms, scene.plan, scene.obstacles, device=problem.device)
    found: list[Branches] = []
    for row, taken in enumerate(evaluation.paths.entry):
        ways = np.concatenate([candidates[[row]], _without(candidates[row], taken)])
        arms, payload = evaluation.arms[np.full(len(ways), row)], float(scene.payload.max())
        chosen = choose_postures(arms, scene.plan, ways, scene.obstacles, problem.device, payload)
        one = Branches(_steps(scene.plan), chosen.branches[0].tolist(), taken.tolist())
        if len(ways) > 1:
            other = chosen.candidate[1 + chosen.cost[1:].argmin()]
            differs = np.abs(other - taken).max(axis=1) > SAME
            steps = [str(step) for step, is_other in sorted(zip(one.steps, differs, strict=True)) if is_other]
            way = f"the best other way, with another branch in step{'s' * (len(steps) > 1)} {', '.join(steps)},"
            there = problem.physics(matrix[[row]], entry=other[None, None])
            one = replace(one, other=other.tolist(), why=f"{way} {_judged(problem, there, evaluation, row)}")
        found.append(one)
    return found


def _without(candidates: Array, taken: Array) -> Array:
    """Return (n, B, K, D) of candidates (B, K, D): each time without the one taken (B, D) at one pose with others."""
    same = np.abs(candidates - taken[:, None]).max(axis=2) <= SAME
    has_others = (~same & ~np.isnan(candidates[..., 0])).any(axis=1)
    ways = np.repeat(candidates[None], has_others.sum(), axis=0)
    for way, block in zip(ways, np.flatnonzero(has_others), strict=True):
        way[block, same[block]] = np.nan
    return ways


def _judged(problem: Problem, other: Evaluation, taken: Evaluation, row: int) -> str:
    """Return what a design violates on another way, else its objectives that differ from those on the way taken.

    other: of the design alone.  taken: of all designs, of which it is row `row`.
    """
    violated = describe_violated(problem.constraints, problem.violations(other)[0].tolist())
    if violated:
        others = len(violated) - MOST
        return f"violates {', '.join(violated[:MOST])}{f' and {others} more' if others > 0 else ''}"
    objectives = problem.objectives if problem.evaluator is None else ()
    values = [(one, f"{one.minimised(other)[0]:.4g}", f"{one.minimised(taken)[row]:.4g}") for one in objectives]
    texts = [f"{one.label.lower()} {new} instead of {old} {one.unit}" for one, new, old in values if new != old]
    return f"has {', '.join(texts)}" if texts else "is equally good"


def _steps(plan: CyclePlan) -> list[int]:
    """Return the number of the step that ends at the first pose of each block, 1 if the cycle starts there."""
    into = [plan.motions[index].step + 1 for index in plan.joint_motions]
    return [into[-1] if into and plan.cycle.closed else 1, *into[: len(plan.blocks) - 1]]

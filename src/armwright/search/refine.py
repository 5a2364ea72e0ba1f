"""Refinement of front designs: a local search over lengths and base position, on the batched kernels.

The paper finds that a language model writes rounded numbers and cannot tune them. Joint types stay as they are. A
refined design is better in every objective than the original.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import moocore
import numpy as np

from armwright.pareto import hypervolume
from armwright.runs.history import REFINE, FrontMember, History
from armwright.search.cma_es import Refined, refine
from armwright.seeding import REFINING, derived_seed
from armwright.spaces.parameters import Design

EVALUATIONS = 1000  # per design


@dataclass(frozen=True)
class Refinement:
    """Refinement of the design of one trial.

    Attributes:
        refines: number of the trial.
        design: the better design, or None if none was found.
        evaluations: number of evaluations spent.
    """

    refines: int
    design: Design | None
    evaluations: int


def refine_one(history: History, seed: int) -> Refinement:
    """Refine the next design of the front; `seed` is the one of the run."""
    member = next_to_refine(history)
    refined = refine_members(history, [member], derived_seed(seed, REFINING, len(history)), EVALUATIONS)
    (design,) = history.problem.space.designs(refined.matrix)
    return Refinement(member.number, design if refined.improved[0] else None, refined.evaluations)


def worth_refining(history: History) -> list[FrontMember]:
    """Return the front within the reference box, or the whole front if it lies outside."""
    inside = [member for member in history.front if np.all(np.array(member.values) < history.reference_point)]
    return inside or history.front


def next_to_refine(history: History) -> FrontMember:
    """Return the design with the largest hypervolume contribution, preferably one not involved in a refinement yet."""
    members = worth_refining(history)
    tried = {trial.refines for trial in history}
    fresh = [m for m in members if m.source != REFINE and m.number not in tried] or members
    values = np.array([member.values for member in members])
    reference = history.reference_point
    assert reference is not None  # known after the random trials
    if values.shape[1] == 1 or hypervolume(values, reference) == 0.0:
        return fresh[0]
    contributions = moocore.hv_contributions(values, ref=list(reference))
    contribution = {member.number: float(c) for member, c in zip(members, contributions, strict=True)}
    return max(fresh, key=lambda member: contribution[member.number])


def refine_members(history: History, members: Sequence[FrontMember], seed: int, evaluations: int) -> Refined:
    """Refine the designs of `members`, with so many evaluations each."""
    problem = history.problem
    values = np.array([member.values for member in members])
    assert history.reference_point is not None
    return refine(
        problem.space.parameters,
        lambda matrix: problem.evaluate_matrix(matrix).penalised,
        problem.space.matrix([member.design for member in members]),
        values,
        history.reference_point,
        evaluations,
        seed,
    )

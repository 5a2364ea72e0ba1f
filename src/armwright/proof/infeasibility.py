"""Why no design of a run is feasible: constraints that conflict, the nearest design, bounds that would admit one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import combinations
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.pareto import NOT_EVALUATED, total_violation
from armwright.problem.branches import branches_of
from armwright.problem.constraints import Constraint, describe_violated
from armwright.proof.cycle_faults import describe_faults, path_record
from armwright.runs.history import History

DIGITS = 3  # of a bound that would admit a design, rounded so that it does
MAX_CONFLICT = 4  # constraints that are named together


@dataclass
class ViolationTally:
    """Evaluated designs, grouped by the constraints that they satisfy."""

    n_constraints: int  # number C of constraints
    # Number of designs of each group, whose key has bit i set for a satisfied constraint i
    counts: dict[int, int] = field(default_factory=dict[int, int])
    # (C,) violations of the design of each group with the smallest total
    nearest: dict[int, Array] = field(default_factory=dict[int, Array])

    @classmethod
    def of(cls, violations: Array) -> Self:
        """Return the tally of designs by their violations (N, C)."""
        tally = cls(violations.shape[1])
        tally.add(violations)
        return tally

    def add(self, violations: Array, counts: Sequence[int] | None = None) -> None:
        """Add designs by their violations (N, C), each standing for a number of designs, by default 1."""
        if not len(violations):
            return
        keys = (violations <= 0.0) @ (1 << np.arange(self.n_constraints))
        weights, totals = np.ones(len(keys)) if counts is None else np.array(counts), total_violation(violations)
        order = np.lexsort((totals, keys))
        groups, first = np.unique(keys[order], return_index=True)
        for key, row in zip(groups.tolist(), order[first].tolist(), strict=True):
            self.counts[key] = self.counts.get(key, 0) + int(weights[keys == key].sum())
            known = self.nearest.get(key)
            if known is None or totals[row] < total_violation(known[None])[0]:
                self.nearest[key] = violations[row].copy()

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the tally as arrays, for `restore`."""
        groups = sorted(self.counts)
        return {
            "tally_counts": np.array([self.counts[key] for key in groups], dtype=np.int64),
            "tally_nearest": np.array([self.nearest[key] for key in groups]).reshape(len(groups), self.n_constraints),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Replace the tally by that of a state."""
        self.counts, self.nearest = {}, {}
        self.add(state["tally_nearest"], state["tally_counts"].tolist())

    @property
    def n_designs(self) -> int:
        """Number of all designs."""
        return sum(self.counts.values())

    def n_satisfying(self, chosen: Sequence[int]) -> int:
        """Return the number of designs that satisfy all constraints of these indices."""
        bits = sum(1 << i for i in chosen)
        return sum(count for key, count in self.counts.items() if key & bits == bits)

    def conflicts(self) -> list[tuple[int, ...]]:
        """Return the smallest sets of constraints, by index, that no design satisfies together.

        These are all evaluated constraints that none satisfies at all, else the first set of the smallest size.
        """
        evaluated = (np.array(list(self.nearest.values())) < NOT_EVALUATED).any(axis=0)
        every = np.flatnonzero(evaluated).tolist()
        never = [(i,) for i in every if not self.n_satisfying([i])]
        if never:
            return never
        sets = (chosen for size in range(2, MAX_CONFLICT + 1) for chosen in combinations(every, size))
        return [next((chosen for chosen in sets if not self.n_satisfying(chosen)), tuple(every))]


def conflict_record(constraints: Sequence[Constraint], tally: ViolationTally) -> dict[str, Any]:
    """Return which constraints conflict among infeasible designs, and the smallest changes that would admit one.

    Returns:
        designs: Number of designs.
        satisfied_by: Number of designs that satisfy each constraint.
        conflicts: Smallest sets of constraints that no design satisfies together.
        admitting: Constraints with other bounds, of the smallest sum of relative changes, that admit one of them;
            bounds of 0 change only if no design meets all of these; empty if none was evaluated to the end.
        admitting_alone: The smallest change of a single bound that does; None if no design violates only one.
    """
    names = [constraint.description for constraint in constraints]
    rows = np.array(list(tally.nearest.values()))
    # Nobody loosens a bound of 0, such as that of unreached targets or collisions, while another bound will do.
    rigid = np.array([constraint.bound == 0.0 for constraint in constraints])
    is_adjustable = ~(rows[:, rigid] > 0.0).any(axis=1)
    rows = rows[is_adjustable] if is_adjustable.any() else rows
    rows = rows[(rows < NOT_EVALUATED).all(axis=1)]  # no bound is known that admits others
    totals, violated = total_violation(rows), (rows > 0.0).sum(axis=1)
    alone = np.flatnonzero(violated == 1)
    single = None if not len(alone) else _loosened(constraints, rows[alone[np.argmin(totals[alone])]])[0]
    return {
        "designs": tally.n_designs,
        "satisfied_by": {name: tally.n_satisfying([i]) for i, name in enumerate(names)},
        "conflicts": [[names[i] for i in chosen] for chosen in tally.conflicts()],
        "admitting": _loosened(constraints, rows[np.argmin(totals)]) if len(rows) else [],
        "admitting_alone": single,
    }


def _loosened(constraints: Sequence[Constraint], violations: Array) -> list[str]:
    """Return the violated constraints with bounds that a design of these violations (C,) satisfies."""
    return [
        f"{constraint.quantity.name} {constraint.relation} {_rounded(constraint, violation):.12g}"
        for constraint, violation in zip(constraints, violations.tolist(), strict=True)
        if violation > 0.0
    ]


def _rounded(constraint: Constraint, violation: float) -> float:
    """Return a bound of few digits that a design with this violation satisfies."""
    value = constraint.measured(violation)
    if not value:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(abs(value))) - DIGITS + 1)
    outwards = math.ceil if constraint.relation == "<=" else math.floor
    return float(f"{step * outwards(value / step - (1e-9 if outwards is math.ceil else -1e-9)):.{DIGITS}g}")


def describe_infeasibility(history: History, feasibility: Mapping[str, Any] | None = None) -> str:
    """Describe why a history has no feasible design.

    feasibility: `feasibility_record` of all evaluated designs, of which the history of a direct search holds only some;
        None for that of the history.
    """
    (number,) = history.nearest(1)
    failure, constraints = history.trials[number].failure, history.problem.constraints
    if failure is not None:
        return f"no evaluation succeeded; that of #{number}: {failure.description}"
    found: Mapping[str, Any] = feasibility or {}
    if found.get("nearest") is None:
        found = feasibility_record(history)["feasibility"]
    violated = describe_violated(constraints, history.violations[number].tolist())
    others = f", and {', '.join(violated[1:])}" if len(violated) > 1 else ""
    along = f"; along its cycle: {found['nearest']['faults']}" if found["nearest"]["faults"] else ""
    return (
        f"no design meets all constraints yet; the nearest, #{number}, violates {violated[0]} most{others}{along}; "
        f"{describe_conflict(found['conflict'])}"
    )


def describe_conflict(record: Mapping[str, Any]) -> str:
    """Return a record of conflicts in words."""
    designs, met = record["designs"], record["satisfied_by"]
    parts: list[str] = []
    for names in record["conflicts"]:
        together = " and ".join(names) + (" together" if len(names) > 1 else "")
        alone = f" ({', '.join(f'{met[name]:,}' for name in names)} alone)" if len(names) > 1 else ""
        none = f"none of {designs:,} designs satisfies" if designs > 1 else "the only design does not satisfy"
        parts.append(f"{none} {together}{alone}")
    if record["admitting"]:
        parts.append(f"bounds that would admit one: {', '.join(record['admitting'])}")
    single = record["admitting_alone"]
    if single is not None and record["admitting"] != [single]:
        parts.append(f"a single one: {single}")
    return "; ".join(parts)


def feasibility_record(history: History, tally: ViolationTally | None = None) -> dict[str, Any]:
    """Return how many designs violate each constraint; empty for a task without constraints.

    tally: All evaluated designs, if the history does not hold them.

    Returns:
        nearest: If no design is feasible, the one with the smallest violation, the quantities that constraints bound,
            where along its cycle it is worst, where it fails to follow it, in words, and its branches.
        conflict: If no design is feasible, the result of `conflict_record`.
    """
    constraints = history.problem.constraints
    if not constraints:
        return {}
    names = [constraint.description for constraint in constraints]
    nearest = conflict = None
    if not history.failed.all() and not history.feasible.any():
        (number,) = history.nearest(1)
        violations, evaluation = history.violations[number], history.evaluation([number])
        branches = branches_of(history.problem, history.matrix([number]), history.entry([number]))
        measured = [constraint.measured(value) for constraint, value in zip(constraints, violations, strict=True)]
        nearest = {
            "number": number,
            "violation": float(total_violation(violations[None] * (violations < NOT_EVALUATED))[0]),
            "measured": dict(zip(names, measured, strict=True)),
            **path_record(evaluation, 0),
            "faults": "; ".join(filter(None, [describe_faults(evaluation, 0), *map(str, branches)])),
            **({"branches": asdict(branches[0])} if branches else {}),
        }
        conflict = conflict_record(constraints, tally or ViolationTally.of(history.violations[~history.failed]))
    counts = ((history.violations > 0.0) & (history.violations < NOT_EVALUATED)).sum(axis=0).tolist()
    return {
        "feasibility": {
            "infeasible": int((~history.feasible).sum()),
            "violated_by": dict(zip(names, counts, strict=True)),
            "nearest": nearest,
            "conflict": conflict,
        }
    }

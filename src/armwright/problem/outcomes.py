"""Results of evaluating designs."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.cycle.line_following import IndexArray
from armwright.pareto import penalised_objectives
from armwright.problem.failure import Failure


@dataclass(frozen=True)
class Outcome:
    """Hold the result of evaluating one design."""

    values: tuple[float, ...]  # the M objectives, minimised; infinite if not evaluated or if the evaluator failed
    violations: tuple[float, ...] = ()  # of the C constraints; satisfied at <= 0; NOT_EVALUATED
    failure: Failure | None = None  # why the evaluator failed; None if it did not
    # Joint angles [rad] or strokes [m] at each target in the first case, 0 for joints that the design lacks
    q: tuple[tuple[float, ...], ...] = ()
    # Likewise at the first pose of each block of the cycle in each case, from which its paths are found again
    entry: tuple[tuple[tuple[float, ...], ...], ...] = ()


@dataclass(frozen=True)
class Outcomes:
    """Hold the results of evaluating N designs."""

    values: Array  # (N, M) objectives, minimised; infinite where not evaluated or the evaluator failed
    violations: Array  # (N, C) constraint violations; satisfied at <= 0; NOT_EVALUATED where that is so
    failures: Mapping[int, Failure] = field(default_factory=dict[int, Failure])  # why the evaluator failed, by row
    # (N, C, B, D) at the first pose of each block of the cycle in each case [rad] or [m]; None without a cycle
    entry: Array | None = None
    q: Array | None = None  # (N, T, J) joint angles at the targets in the first case [rad] or [m]

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, row: int) -> Outcome:
        """Return the outcome of one design."""
        q, entry = (() if array is None else _singles(array[row].tolist()) for array in (self.q, self.entry))
        values, violations = (tuple(array[row].tolist()) for array in (self.values, self.violations))
        return Outcome(values, violations, self.failures.get(row), q, entry)

    def __iter__(self) -> Iterator[Outcome]:
        return (self[row] for row in range(len(self)))

    def replaced(self, rows: IndexArray, others: "Outcomes", chosen: NDArray[np.bool_]) -> "Outcomes":
        """Return the outcomes in which those chosen of others take the place of these rows."""
        changed = {name: np.array(getattr(self, name)) for name in ("values", "violations", "entry", "q")
                   if getattr(self, name) is not None}  # fmt: skip
        for name, values in changed.items():
            values[rows] = getattr(others, name)[chosen]
        return replace(self, **changed)

    @property
    def penalised(self) -> Array:
        """Return (N, M) objectives that a search without constraints can compare designs by (Deb's rules)."""
        return penalised_objectives(self.values, self.violations)


def worst_case(outcomes: Iterable[Outcomes]) -> Outcomes:
    """Return the largest of each objective and violation, each by itself, of the same designs in several cases.

    The postures are those of the first one, at entries those of all that have some.
    """
    first, *others = outcomes
    if not others:
        return first
    values, violations = (
        np.max([getattr(o, name) for o in (first, *others)], axis=0) for name in ("values", "violations")
    )
    entries = [o.entry for o in (first, *others) if o.entry is not None]
    return Outcomes(values, violations, entry=np.concatenate(entries, axis=1) if entries else None, q=first.q)


def joined(parts: Sequence[Outcomes]) -> Outcomes:
    """Return the outcomes of all designs of several parts, in their order; at least one part."""

    def all_of(name: str) -> Any:
        arrays = [getattr(part, name) for part in parts]
        return None if arrays[0] is None else np.concatenate(arrays)

    return Outcomes(all_of("values"), all_of("violations"), entry=all_of("entry"), q=all_of("q"))


def _singles(values: Any) -> Any:
    """Return numbers of single precision, as the kernels compute, in as few digits as tell each from all others."""
    if isinstance(values, float):
        return float(f"{values:.9g}")
    return tuple(map(_singles, values))

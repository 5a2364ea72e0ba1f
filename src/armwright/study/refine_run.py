"""Refine the front of a finished run, and add improved designs to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from armwright.exceptions import RunFolderError, SettingsError
from armwright.runs.folder import RunFolder, read_run
from armwright.runs.history import REFINE, FrontMember, History
from armwright.runs.infeasibility import describe_infeasibility
from armwright.runs.results import discard_results, read_summary, rewrite_results
from armwright.runs.trial import FinishedTrial
from armwright.search.cma_es import POPULATION, Refined
from armwright.search.refine import EVALUATIONS, refine_members, worth_refining
from armwright.seeding import REFINING, derived_seed

MAX_EVALUATIONS = 10**9


@dataclass(frozen=True)
class RefinedRun:
    """Result of refining a run.

    Attributes:
        before: the trials before.
        history: the trials, with the new ones.
        summary: content of summary.json.
        tried: number of designs refined.
        evaluations: number of evaluations spent in all.
    """

    before: History
    history: History
    summary: dict[str, Any]
    tried: int
    evaluations: int

    @property
    def added(self) -> int:
        """Number of designs that were improved."""
        return len(self.history) - len(self.before)


def refine_run(path: str | Path, evaluations: int = EVALUATIONS) -> RefinedRun:
    """Refine each design of the front of a finished run, and add improved designs as trials of source `refine`.

    Another call continues from the front it finds.

    Args:
        path: run folder.
        evaluations: number of evaluations per design.
    """
    if not POPULATION <= evaluations <= MAX_EVALUATIONS:
        raise SettingsError(f"evaluations per design: expected {POPULATION} to {MAX_EVALUATIONS}, got {evaluations}")
    path = Path(path)
    config, _ = read_run(path)
    method = config.study
    if config.evaluator is not None:
        raise SettingsError(
            f"{path} was measured by the evaluator {config.evaluator}, which a refinement would call a thousand times "
            "for each design; continue the run with a larger --n-total instead"
        )
    with RunFolder(path) as folder:
        trials = folder.open_trials(config)
        summary = read_summary(path)
        if len(trials) < method.n_trials or summary is None:
            raise RunFolderError(
                f"{path} is not finished ({len(trials)} of {method.n_trials} trials); rerun the command that began it, "
                "then refine it"
            )
        before = History(config.problem, tuple(trials), method.n_init, config.reference_point)
        members = worth_refining(before)
        if not members:
            raise RunFolderError(f"{path} has no front to refine: {describe_infeasibility(before)}")
        earlier = summary.get("refine") or {"rounds": 0, "in_vain": 0}
        seed = derived_seed(config.seed, REFINING, len(before), earlier["rounds"])
        refined = refine_members(before, members, seed, evaluations)
        improved = _trials(before, members, refined)
        in_vain = earlier["in_vain"] + (0 if improved else refined.evaluations)
        summary = {**summary, "refine": {"rounds": earlier["rounds"] + 1, "in_vain": in_vain}}
        discard_results(path)
        for trial in improved:
            folder.append(trial)
        after = before.grown((*trials, *improved), config.reference_point)
        summary = rewrite_results(folder, after, config, summary)
    return RefinedRun(before, after, summary, len(members), refined.evaluations)


def _trials(history: History, members: Sequence[FrontMember], refined: Refined) -> list[FinishedTrial]:
    """Return a trial for each improved design; all evaluations are divided among them.

    If none was improved, the summary keeps the evaluations: under `refine`, and in its total.
    """
    better = np.flatnonzero(refined.improved).tolist()
    designs = history.problem.space.designs(refined.matrix[better])
    violations = history.problem.evaluate_matrix(refined.matrix[better]).violations
    return [
        FinishedTrial(
            len(history) + k,
            REFINE,
            design,
            tuple(refined.values[i].tolist()),
            violations=tuple(violations[k].tolist()),
            reason=f"refines trial {members[i].number}",
            refines=members[i].number,
            evaluations=refined.evaluations * (k + 1) // len(better) - refined.evaluations * k // len(better),
        )
        for k, (i, design) in enumerate(zip(better, designs, strict=True))
    ]

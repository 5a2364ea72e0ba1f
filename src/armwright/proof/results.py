"""Write the results of a run folder: the summary, the tables, and the designs of the front.

summary.json              the result of the run
trials.csv, front.csv     all trials, and those of the front
designs/NNNN/             each design of the front (design_record.py)
"""

import json
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic_core import to_jsonable_python

from armwright.arrays import Array, finite_or_none
from armwright.files import MAX_DERIVED, naming_write_errors, read_text, replace_folder, to_csv
from armwright.pareto import hypervolume
from armwright.problem.assumptions import assumed_values
from armwright.problem.failure import FAILURE_KINDS
from armwright.proof.attribution import attribution_by_source
from armwright.proof.design_record import DESIGNS, design_name, objective_record, violation_record, write_designs
from armwright.proof.front_gap import front_gap
from armwright.proof.infeasibility import ViolationTally, feasibility_record
from armwright.proof.perturbations import Survival
from armwright.proof.proposer_bias import proposer_bias
from armwright.proof.recommendation import recommend, unlimited
from armwright.proof.summary_file import ProposerSummary, parse_summary
from armwright.proof.verification import Verification, front_survival
from armwright.runs.config import RunConfig
from armwright.runs.folder import RunFolder
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial

SUMMARY = "summary.json"
FIGURES = "figures"  # drawn by pictures/figures.py
REPORT = "report.html"  # made by page/page.py
COMMAND = "command.txt"  # of the command line that made the run
TABLES = ("trials.csv", "front.csv")
MAX_FALLBACK_SHARE = 0.1  # of a proposer's trials; runs with more are flagged, and tables leave them out
PARTS = ("total", "sampling", "evaluation", "proposing")  # of a trial's seconds
CASES = ("exact", "moved")  # in which the objectives of a design are verified


def write_results(
    folder: RunFolder,
    history: History,
    config: RunConfig,
    summary: Mapping[str, Any],
    verification: Verification | None,
) -> None:
    """Write all results, and the summary last: it marks them as complete."""
    verdicts = _verdicts(history, verification)
    rows = [_row(history, trial) for trial in history]
    folder.write_text("trials.csv", to_csv(rows))
    on_front = sorted(member.number for member in history.front)
    folder.write_text("front.csv", to_csv(rows[number] | _flat_verdict(verdicts.get(number)) for number in on_front))
    recommended = {one["design"]: one["survival"] for one in summary.get("recommended", ())}
    survival: dict[int, Any] = {} if verification is None else front_survival(history, verification)
    survival |= {number: one for number, one in recommended.items() if one is not None}
    write_designs(folder, history, verdicts, recommended, survival)
    folder.write_text(SUMMARY, json.dumps(summary, indent=2) + "\n")


def complete_summary(path: Path, history: History) -> dict[str, Any] | None:
    """Return the summary of a run folder that holds all results of these trials; None if one is missing."""
    files = [path / name for name in TABLES]
    files += [
        path / DESIGNS / design_name(m.number) / name for m in history.front for name in ("arm.urdf", "design.json")
    ]
    summary = read_summary(path) if all(file.is_file() for file in files) else None
    return summary if summary is not None and summary["n_trials"] == len(history) else None


def discard_results(path: Path) -> None:
    """Remove the summary, the page and the figures of a run, which is then no longer finished."""
    with naming_write_errors(path):
        (path / SUMMARY).unlink(missing_ok=True)
        (path / REPORT).unlink(missing_ok=True)
        replace_folder(path / FIGURES)


def read_summary(path: Path) -> dict[str, Any] | None:
    """Return the summary of a run folder; None if the run has not ended or the file is damaged."""
    try:
        return parse_summary(read_text(path / SUMMARY, MAX_DERIVED, ValueError))
    except (ValueError, RecursionError):
        return None


def summarize(
    history: History,
    config: RunConfig,
    proposer: ProposerSummary | None,
    verification: Verification | None = None,
    surrogate: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the content of summary.json for a study."""
    curve = history.hypervolume
    seconds: Counter[str] = Counter()
    for trial in history:
        seconds.update(trial.seconds)
    failed = Counter(trial.failure.kind for trial in history if trial.failure is not None)
    screened = Counter(trial.screened.source for trial in history if trial.screened is not None)
    volume = {
        "final": float(curve[-1]) if len(curve) else None,
        "mean": float(curve.mean()) if len(curve) else None,
        "history": curve.tolist(),
    }
    return {
        **_common_record(
            history, config, history.masked_objectives, volume, verification, front_survival(history, verification)
        ),
        "duplicates": sum(trial.duplicate_of is not None for trial in history),
        **({} if config.evaluator is None else {"failures": {kind: failed[kind] for kind in FAILURE_KINDS}}),
        **({"screened_out": dict(screened)} if config.study.screen else {}),
        **({} if surrogate is None else {"surrogate": surrogate}),
        "attribution": {source: asdict(one) for source, one in attribution_by_source(history).items()},
        "proposer": None if proposer is None else _proposer_record(history, proposer),
        "proposer_bias": None if proposer is None else asdict(proposer_bias(history, proposer.name)),
        "seconds": {part: round(seconds[part], 6) for part in PARTS},
        "versions": dict(config.versions),
    }


def summarize_front(
    history: History,
    config: RunConfig,
    found: Array,
    search: Mapping[str, Any],
    verification: Verification | None,
    survival: Mapping[int, Survival],
    tally: ViolationTally | None = None,
    left: Callable[[], float] = unlimited,
) -> dict[str, Any]:
    """Return the content of summary.json for a direct search.

    The trials of `history` are designs of the front, `found` are the (N, M) objectives of the whole front. `search`
    holds evaluations, seconds, why it ended, and the hypervolume over the evaluations. `survival` is of the front, and
    of a safe design beside it, by number. `tally` is of all evaluated designs. `left` returns the time that is left for
    simulations of recommended designs [s].
    """
    volume = {"final": hypervolume(found, history.reference_point or ())}
    return {
        **_common_record(history, config, found, volume, verification, survival, tally, left),
        "search": dict(search),
        "versions": dict(config.versions),
    }


def _common_record(
    history: History,
    config: RunConfig,
    found: Array,
    volume: Mapping[str, Any],
    verification: Verification | None,
    survival: Mapping[int, Survival],
    tally: ViolationTally | None = None,
    left: Callable[[], float] = unlimited,
) -> dict[str, Any]:
    """Return what the summaries of studies and direct searches have in common; found: (N, M) values of the front."""
    reference = history.reference_point
    gap = None if reference is None else front_gap(history.problem, found, reference)
    assumed = assumed_values(history.problem, [member.arm for member in history.front])
    return {
        "task": history.problem.task.name,
        "seed": config.seed,
        "n_trials": len(history),
        "by_source": dict(Counter(trial.source for trial in history)),
        **feasibility_record(history, tally),
        "hypervolume": {"reference_point": list(reference or ()), **volume},
        "front_gap": None if gap is None else asdict(gap),
        "front_size": len(history.front),
        "verification": _verification_record(history, verification),
        **({"assumed": assumed} if assumed else {}),
        **(
            {"recommended": to_jsonable_python(recommend(history, survival, left=left))}
            if history.problem.constraints
            else {}
        ),
    }


def _verification_record(history: History, verification: Verification | None) -> dict[str, Any] | None:
    """Return the number of robust designs, their hypervolume, and the worst-case hypervolume of the front."""
    if verification is None:
        return None
    robust = [member.number for member, holds in zip(history.front, verification.robust, strict=True) if holds]
    holding = [number for number, one in front_survival(history, verification).items() if one.holds]
    reference = history.reference_point or ()
    return {
        "robust": len(robust),
        "sensitive": len(history.front) - len(robust),
        "robust_numbers": robust,
        "verdict": {"numbers": holding, "good": "holds", "bad": "does not hold"}
        if history.problem.constraints
        else {"numbers": robust, "good": "robust", "bad": "sensitive"},
        "hypervolume_of_robust": hypervolume(history.values[robust], reference),
        "hypervolume_worst_case": hypervolume(verification.worst_case, reference),
    }


def _verdicts(history: History, verification: Verification | None) -> dict[int, dict[str, Any]]:
    """Return for each design of the front whether it is robust, and its objectives in each case, by trial number."""
    if verification is None:
        return {}
    return {
        member.number: {
            "robust": bool(verification.robust[i]),
            **({"holds": verification.survival[i].holds} if verification.survival else {}),
            **{case: objective_record(history, getattr(verification, case)[i].tolist()) for case in CASES},
        }
        for i, member in enumerate(history.front)
    }


def _flat_verdict(verdict: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a verdict as columns of front.csv."""
    if verdict is None:
        return {}
    return {
        "verdict": "robust" if verdict["robust"] else "sensitive",
        **({"holds": verdict["holds"]} if "holds" in verdict else {}),
        **{f"{name}_{case}": value for case in CASES for name, value in verdict[case].items()},
    }


def _proposer_record(history: History, proposer: ProposerSummary) -> dict[str, Any]:
    reserved = [trial for trial in history if trial.request is not None]
    fallbacks = sum(trial.fault is not None for trial in reserved)
    record = asdict(proposer)
    notes = record.pop("notes")
    return {
        **record,
        "failures": dict(Counter(trial.fault for trial in reserved if trial.fault)),
        "fallback_share": round(fallbacks / len(reserved), 4) if reserved else 0.0,
        "flagged": fallbacks > MAX_FALLBACK_SHARE * len(reserved),
        "tokens": proposer.input_tokens + proposer.output_tokens,
        **notes,
    }


def _row(history: History, trial: FinishedTrial) -> dict[str, Any]:
    """Return a trial as a row of trials.csv."""
    params = {p.name: trial.design.params.get(p.name) for p in history.problem.space.parameters}
    values = [*map(finite_or_none, trial.values)]
    results = {**objective_record(history, values), **violation_record(history, trial)}
    failure = {} if not history.failed.any() else {"failure": trial.failure.kind if trial.failure else None}
    return {"number": trial.number, "source": trial.source, **params, **results, **failure}

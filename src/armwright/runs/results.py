"""Write the results of a run folder: the summary, tables, and the front's designs.

summary.json              what the run came to
trials.csv, front.csv     all trials, and those of the front
designs/NNNN/arm.urdf     each design of the front, for simulators
designs/NNNN/design.json  and its postures, errors and torques at every target
"""

import json
import shutil
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import RunFolderError
from armwright.files import replace_folder, to_csv
from armwright.pareto import hypervolume, total_violation
from armwright.problem.unreached_reason import unreached_reason
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.attribution import attribution_by_source
from armwright.runs.best_known import front_gap
from armwright.runs.config import FrontMethod, RunConfig
from armwright.runs.folder import RunFolder, read_run
from armwright.runs.history import FrontMember, History
from armwright.runs.proposer_bias import proposer_bias
from armwright.runs.summary import ProposerSummary, checked_summary
from armwright.runs.trial import FinishedTrial
from armwright.runs.verification import Verification, verify_front

SUMMARY = "summary.json"
DESIGNS = "designs"
FIGURES = "figures"  # drawn by report/figures.py
REPORT = "report.html"  # made by report/page.py
TABLES = ("trials.csv", "front.csv")
MOST_FALLBACKS = 0.1  # of a proposer's turns, beyond which its run is flagged and kept out of its row in tables
PARTS = ("total", "sampling", "evaluation", "proposing")  # of a trial's seconds


def write_results(
    folder: RunFolder, history: History, summary: Mapping[str, Any], verification: Verification | None
) -> None:
    """Write all results, and the summary last: it marks them as complete.

    verification: of the front, by rising position error; None where none was made.
    """
    verdicts = _verdicts(history, verification)
    folder.write_text("trials.csv", to_csv(_rows(history)))
    on_front = {member.number for member in history.front}
    rows = [row | _flat_verdict(verdicts.get(row["number"])) for row in _rows(history) if row["number"] in on_front]
    folder.write_text("front.csv", to_csv(rows))
    _write_designs(folder, history, verdicts)
    folder.write_text(SUMMARY, json.dumps(summary, indent=2) + "\n")


def verify_run(path: str | Path) -> tuple[History, dict[str, Any]]:
    """Verify the front of a finished run again, rewrite its results, and return history and summary."""
    path = Path(path)
    config, history = read_run(path)
    summary = read_summary(path)
    if summary is None:
        raise RunFolderError(f"{path} is not finished: give the command that began it once more")
    with RunFolder(path) as folder:
        verification = verify_front(history)
        summary = resummarize(summary, history, config, verification)
        write_results(folder, history, summary, verification)
    return history, summary


def complete_summary(path: Path, history: History) -> dict[str, Any] | None:
    """Return the summary of a run folder that holds all results of these trials; None if one is missing."""
    files = [path / name for name in TABLES]
    files += [path / DESIGNS / _name(m) / name for m in history.front for name in ("arm.urdf", "design.json")]
    summary = read_summary(path) if all(file.is_file() for file in files) else None
    return summary if summary is not None and summary["n_trials"] == len(history) else None


def discard_results(path: Path) -> None:
    """Remove the summary, the page and the figures of a run, so that it is not finished."""
    try:
        (path / SUMMARY).unlink(missing_ok=True)
        (path / REPORT).unlink(missing_ok=True)
        replace_folder(path / FIGURES)
    except OSError as fault:
        raise RunFolderError(f"cannot remove the old results in {path}: {fault.strerror or fault}") from fault


def read_summary(path: Path) -> dict[str, Any] | None:
    """summary.json of a run folder, or None where the run has not ended (or the file is damaged)."""
    try:
        return checked_summary(json.loads((path / SUMMARY).read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError):
        return None


def summarize(
    history: History,
    config: RunConfig,
    proposer: ProposerSummary | None,
    verification: Verification | None = None,
) -> dict[str, Any]:
    """Return the content of summary.json for a study."""
    curve = history.hypervolume
    counted = curve[: config.study.n_total]  # without what was refined afterwards
    seconds: Counter[str] = Counter()
    for trial in history:
        seconds.update(trial.seconds)
    return {
        "task": history.problem.task.name,
        "seed": config.seed,
        "n_trials": len(history),
        "by_source": dict(Counter(trial.source for trial in history)),
        **_feasibility_record(history),
        "hypervolume": {
            "reference_point": list(history.reference_point or ()),
            "final": float(curve[-1]) if len(curve) else None,
            "mean": float(counted.mean()) if len(counted) else None,
            "history": curve.tolist(),
        },
        "best_known": _front_gap_record(history, history.masked_objectives),
        "front_size": len(history.front),
        "verification": _verification_record(history, verification),
        "evaluations": sum(trial.evaluations for trial in history),
        "duplicates": sum(trial.duplicate_of is not None for trial in history),
        "refine": None,
        "attribution": {source: asdict(one) for source, one in attribution_by_source(history).items()},
        "proposer": None if proposer is None else _proposer_record(history, config, proposer),
        "proposer_bias": None if proposer is None else asdict(proposer_bias(history, proposer.name)),
        "seconds": {part: round(seconds[part], 6) for part in PARTS},
        "versions": dict(config.versions),
    }


def summarize_front(
    history: History, config: RunConfig, found: Array, search: Mapping[str, Any], verification: Verification | None
) -> dict[str, Any]:
    """Return the content of summary.json for a search for the whole front.

    found: (N, M) the whole front, of which `history` may hold a part only.
    search: evaluations, seconds, why it ended, and the hypervolume over the evaluations.
    """
    reference = history.reference_point or ()
    return {
        "task": history.problem.task.name,
        "seed": config.seed,
        "n_trials": len(history),
        "by_source": dict(Counter(trial.source for trial in history)),
        **_feasibility_record(history),
        "hypervolume": {"reference_point": list(reference), "final": hypervolume(found, reference)},
        "best_known": _front_gap_record(history, found),
        "front_size": len(history.front),
        "verification": _verification_record(history, verification),
        "search": dict(search),
        "versions": dict(config.versions),
    }


def resummarize(
    summary: Mapping[str, Any], history: History, config: RunConfig, verification: Verification | None
) -> dict[str, Any]:
    """Return the summary after trials were added or designs verified; keep what only its sessions knew."""
    if isinstance(config.method, FrontMethod):
        return {**summary, "verification": _verification_record(history, verification)}
    known = {key: summary[key] for key in ("proposer", "proposer_bias", "refine") if key in summary}
    new = summarize(history, config, None, verification) | known
    if new["refine"] is not None:
        new["evaluations"] += new["refine"]["in_vain"]
    return new


def unmet(history: History) -> str:
    """Where no design is feasible: how near the nearest comes, and which constraint is in the way."""
    (number,) = history.nearest(1)
    broken = history.violations[number]
    constraints = history.problem.constraints
    words = [
        f"{constraints[i].description} ({constraints[i].measured(float(broken[i])):.4g} {constraints[i].quantity.unit})"
        for i in np.argsort(-broken, kind="stable")
        if broken[i] > 0.0
    ]
    rest = f", and {', '.join(words[1:])}" if len(words) > 1 else ""
    return f"no design meets all constraints yet; the nearest, #{number}, breaks {words[0]} most{rest}"


def _feasibility_record(history: History) -> dict[str, Any]:
    """How many designs break constraints, and which; nothing of a task without any.

    nearest: of no feasible design, the one that breaks them least, and by how much, in the quantities' own units.
    """
    constraints = history.problem.constraints
    if not constraints:
        return {}
    breaking = (history.violations > 0.0).sum(axis=0).tolist()
    nearest = None
    if len(history) and not history.feasible.any():
        (number,) = history.nearest(1)
        measured = {
            c.description: c.measured(value) for c, value in zip(constraints, history.violations[number], strict=True)
        }
        nearest = {
            "number": number,
            "violation": float(total_violation(history.violations[[number]])[0]),
            "measured": measured,
        }
    return {
        "feasibility": {
            "infeasible": int((~history.feasible).sum()),
            "violated_by": {c.description: n for c, n in zip(constraints, breaking, strict=True)},
            "nearest": nearest,
        }
    }


def _front_gap_record(history: History, found: Array) -> dict[str, Any] | None:
    """Compare a front with the best known one, if there is one."""
    if history.reference_point is None:
        return None
    gap = front_gap(history.problem, found, history.reference_point)
    return None if gap is None else asdict(gap)


def _verification_record(history: History, verification: Verification | None) -> dict[str, Any] | None:
    """Return the number of robust designs, their hypervolume, and the worst-case hypervolume of the front."""
    if verification is None:
        return None
    robust = [member.number for member, holds in zip(history.front, verification.robust, strict=True) if holds]
    reference = history.reference_point or ()
    return {
        "robust": len(robust),
        "sensitive": len(history.front) - len(robust),
        "robust_numbers": robust,
        "hypervolume_of_robust": hypervolume(history.values[robust], reference),
        "robust_from_any_start": int(verification.from_any_start.sum()),
        "hypervolume_worst_case": hypervolume(verification.worst_case, reference),
    }


def _verdicts(history: History, verification: Verification | None) -> dict[int, dict[str, Any]]:
    """Return for each design of the front whether it is robust, and its objectives in each case."""
    if verification is None:
        return {}
    return {
        member.number: {
            "robust": bool(verification.robust[i]),
            "from_any_start": bool(verification.from_any_start[i]),
            "exact": _objectives(history, verification.exact[i].tolist()),
            "moved": _objectives(history, verification.moved[i].tolist()),
            "started": _objectives(history, verification.started[i].tolist()),
        }
        for i, member in enumerate(history.front)
    }


def _flat_verdict(verdict: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a verdict as columns of front.csv."""
    if verdict is None:
        return {}
    kinds = ("exact", "moved", "started")
    columns = {f"{name}_{kind}": value for kind in kinds for name, value in verdict[kind].items()}
    verdict_ = "robust" if verdict["robust"] else "sensitive"
    return {"verdict": verdict_, "from_any_start": "yes" if verdict["from_any_start"] else "no", **columns}


def _proposer_record(history: History, config: RunConfig, proposer: ProposerSummary) -> dict[str, Any]:
    turns = [trial for trial in history if trial.proposal is not None or trial.fault is not None]
    fallbacks = sum(trial.fault is not None for trial in turns)
    return {
        "name": proposer.name,
        "model": proposer.model,
        "origin": proposer.origin,
        "calls": proposer.calls,
        "call_failures": dict(proposer.call_failures),
        "failures": dict(Counter(trial.fault for trial in turns if trial.fault)),
        "fallback_share": round(fallbacks / len(turns), 4) if turns else 0.0,
        "flagged": fallbacks > MOST_FALLBACKS * len(turns),
        "tokens": proposer.input_tokens + proposer.output_tokens,
        "input_tokens": proposer.input_tokens,
        "output_tokens": proposer.output_tokens,
        "cost_usd": proposer.cost_usd,
        "call_seconds": proposer.seconds,
        **proposer.notes,
        "overlap": _overlap_record(history, config, turns),
    }


def _overlap_record(history: History, config: RunConfig, turns: Sequence[FinishedTrial]) -> dict[str, Any] | None:
    """Return the share of proposals among the counted trials and the age of their feedback [trials] (`in_flight`).

    ratio_with_failures: the share of the proposer's turns, those included that became black-box trials.
    """
    method = config.study
    if method.in_flight is None:
        return None
    ages = [trial.number - trial.feedback if trial.feedback is not None else 0 for trial in turns if trial.proposal]
    counted = max(1, len(history) - history.n_init)
    return {
        "in_flight": method.in_flight,
        "ratio_planned": round(method.n_proposals / method.n_total, 4),
        "ratio": round(len(ages) / counted, 4),
        "ratio_with_failures": round(len(turns) / counted, 4),
        "feedback_age": {"mean": round(sum(ages) / len(ages), 2), "max": max(ages)} if ages else None,
    }


def _write_designs(folder: RunFolder, history: History, verdicts: Mapping[int, Mapping[str, Any]]) -> None:
    names = {_name(member) for member in history.front}
    for stale in (folder.path / DESIGNS).glob("[0-9]*"):
        if stale.name not in names:
            shutil.rmtree(stale)
    for member, record in zip(history.front, _design_records(history, history.front), strict=True):
        place = f"{DESIGNS}/{_name(member)}"
        urdf = to_urdf(member.arm, name=f"{history.problem.task.name}-{member.number}")
        folder.write_text(f"{place}/arm.urdf", urdf)
        verdict = verdicts.get(member.number)
        content = record if verdict is None else record | {"verification": dict(verdict)}
        folder.write_text(f"{place}/design.json", json.dumps(content, indent=2) + "\n")


def _name(member: FrontMember) -> str:
    return f"{member.number:04d}"


def _design_records(history: History, members: Sequence[FrontMember]) -> Iterable[dict[str, Any]]:
    evaluation = history.evaluation([member.number for member in members])
    for row, member in enumerate(members):
        yield {
            "number": member.number,
            "source": member.source,
            "reason": history.trials[member.number].reason,
            "params": dict(member.design.params),
            "objectives": _objectives(history, member.values),
            **_violations(history, member.number),
            "masses": history.problem.space.mass_note,
            "targets": [
                {
                    "target": evaluation.targets[t].tolist(),
                    "q": evaluation.q[row, t, : len(member.arm.joints)].tolist(),
                    "reached": evaluation.reached[row, t].tolist(),
                    "position_error": float(evaluation.position_error[row, t]),
                    **(
                        {"angle_error": float(evaluation.angle_error[row, t])}
                        if evaluation.target_arrays.n_angular[t]
                        else {}
                    ),
                    "unreached_reason": unreached_reason(member.arm, evaluation, row, t) or None,
                    "joint_torques": evaluation.joint_torques[row, t, : len(member.arm.joints)].tolist(),
                }
                for t in range(len(evaluation.targets))
            ],
        }


def _rows(history: History) -> Iterable[dict[str, Any]]:
    for trial in history:
        objectives = _objectives(history, trial.values)
        params = {p.name: trial.design.params.get(p.name) for p in history.problem.space.parameters}
        broken = dict(zip((c.description for c in history.problem.constraints), trial.violations, strict=True))
        yield {"number": trial.number, "source": trial.source, **params, **objectives, **broken}


def _violations(history: History, number: int) -> dict[str, Any]:
    """Return the violation of each constraint by one design; empty for a task without any."""
    names = [constraint.description for constraint in history.problem.constraints]
    return {"violations": dict(zip(names, history.trials[number].violations, strict=True))} if names else {}


def _objectives(history: History, values: Sequence[float]) -> dict[str, float]:
    return {o.name: value for o, value in zip(history.problem.objectives, values, strict=True)}

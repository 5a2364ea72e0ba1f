"""The data sheet of a design of a run."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armwright.arrays import finite_or_none
from armwright.files import MAX_DERIVED, read_text
from armwright.problem.assumptions import assumed_values, describe_assumed
from armwright.problem.facts import Facts, reach_facts
from armwright.problem.over_reach import reach_lines
from armwright.proof.design_record import read_records
from armwright.proof.recommendation import NOT_SIMULATED
from armwright.proof.results import read_summary
from armwright.proof.selection import pick
from armwright.proof.simulation_files import SIMULATION
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.sheet.arm_drawing import drawing_of, link_line
from armwright.sheet.joint_lines import joint_lines
from armwright.sheet.parts import mass_lines, parts_list
from armwright.sheet.record import DataSheet
from armwright.sheet.sensitivities import sensitivities
from armwright.text import rounded

SHEET_VALUES = ("backlash", "joint_stiffness")  # of actuators, which a sheet depends on whatever the objectives
NO_ACTUATORS = "the space names no actuators"


@dataclass(frozen=True)
class Verdict:
    """What a run found about a design, as in `DataSheet`."""

    role: str = ""
    status: str = NOT_SIMULATED
    survival: str = ""


def design_sheet(run: Path, number: int | None = None) -> DataSheet:
    """Return the data sheet of a design of a run; by default of the first recommended one.

    Raises:
        FailureError: No number is given, and no design is feasible.
        SettingsError: The run has no such design.
    """
    _, history = read_run(run)
    recommended = (read_summary(run) or {}).get("recommended", ())
    chosen = _first(history, recommended) if number is None else number
    member = history.member(chosen)
    records = [one for one in recommended if one["design"] == chosen]
    facts = read_records(run, history, [chosen])[chosen].facts
    return sheet_of(history, member, facts, _verdict(run, chosen, records))


def _first(history: History, recommended: Sequence[Mapping[str, Any]]) -> int:
    """Return the first recommended design, or the knee of the front; FailureError without a feasible design."""
    return int(recommended[0]["design"]) if recommended else pick(history)[0].number


def sheet_of(history: History, member: FrontMember, facts: Facts, verdict: Verdict) -> DataSheet:
    """Return the data sheet of a design of which these facts are known, with a verdict."""
    problem, arm = history.problem, member.arm
    evaluation = history.evaluation([member.number])
    payload = float(problem.task.payloads.max())
    over_reach = reach_lines(arm, payload)
    return DataSheet(
        name=problem.task.name,
        design=member.number,
        joint_letters=member.design.joints,
        base_position=arm.base,
        base_yaw=0.0,
        role=verdict.role,
        status=verdict.status,
        survival=verdict.survival,
        violated=_violated(history, member.number),
        objectives=_objectives(history, member),
        payload=payload or None,
        facts={**reach_facts(over_reach[-1]), **facts},
        joints=joint_lines(arm, evaluation),
        links=tuple(link_line(arm, n) for n in range(1, len(arm.links) + 1)),
        masses=mass_lines(arm),
        parts=parts_list(arm, problem.space),
        over_reach=over_reach,
        sensitivities=sensitivities(problem, member.design),
        drawing=drawing_of(arm, evaluation.targets),
        assumptions=_assumptions(history, member, payload),
    )


def _verdict(run: Path, number: int, records: Sequence[Mapping[str, Any]]) -> Verdict:
    """Return the verdict on a design; records: its own among the recommended ones, one for each role."""
    if records:
        first, roles = records[0], ", ".join(one["role"] for one in records)
        return Verdict(roles, first["status"], "" if first["survival"] is None else first["survival"]["verdict"])
    try:
        simulated = json.loads(read_text(run / SIMULATION, MAX_DERIVED, ValueError))["designs"]
        status = next((str(one["verdict"]) for one in simulated if one["design"] == number), NOT_SIMULATED)
    except (ValueError, LookupError, TypeError):  # none, or a damaged file
        status = NOT_SIMULATED
    return Verdict(status=f"{status}; not among the recommended designs")


def _objectives(history: History, member: FrontMember) -> dict[str, tuple[float | None, str]]:
    pairs = zip(history.problem.objectives, member.values, strict=True)
    return {objective.name: (finite_or_none(value), objective.unit) for objective, value in pairs}


def _violated(history: History, number: int) -> tuple[str, ...]:
    """Return the constraints that a design violates, with what it has, or why its evaluation failed."""
    trial = history.trials[number]
    if trial.failure is not None:
        return (f"its evaluation failed: {trial.failure.reason}",)
    return tuple(
        f"{constraint.description} (it has {rounded(constraint.measured(violation))})"
        for constraint, violation in zip(history.problem.constraints, trial.violations, strict=True)
        if violation > 0.0
    )


def _assumptions(history: History, member: FrontMember, payload: float) -> dict[str, str]:
    """Return what the values assume, by what they are about."""
    problem, arm = history.problem, member.arm
    driven = any(joint.actuator is not None for joint in arm.joints)
    found = {
        "masses": problem.space.mass_note,
        "reach": "horizontal distance of the tip from the first joint; the outlines show the farthest point found in "
        "each of 72 directions around the base, without obstacles",
        "errors": f"at the targets of the task, with its payload of {payload:g} kg; static, small displacements; "
        "backlash is the sum of half the play of all joints",
        "over the reach": "the least favourable of all postures found, in directions in which the arm reaches nearly "
        f"as far as in any; deflection with {payload:g} kg at the tip",
        "sensitivities": "each change alone, with postures of its own; errors are the largest at the targets",
    }
    if driven:
        found["utilisation"] = f"with a safety factor of {arm.safety_factor:g}; motors at their stated voltage"
        found["current"] = "positive mechanical power and copper loss; standby current comes on top"
    if assumed := assumed_values(problem, [arm], also=SHEET_VALUES):
        found["actuators"] = f"defaults of their kind or estimates: {describe_assumed(assumed)}"
    if unpriced := [part.part for part in parts_list(arm, problem.space) if part.price is None]:
        found["price"] = f"of the parts that state one; not of {', '.join(unpriced)}"
    if problem.evaluator is not None:
        found["objectives"] = "by the custom evaluator of the run; all else by the built-in physics"
    return found

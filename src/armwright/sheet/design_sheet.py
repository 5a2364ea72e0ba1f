"""The data sheet of a design of a run."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from armwright.arrays import finite_or_none
from armwright.files import MAX_DERIVED, read_text
from armwright.problem.assumptions import assumed_values, describe_assumed
from armwright.problem.constraints import describe_violated
from armwright.problem.facts import Facts, reach_facts
from armwright.proof.design_record import read_records
from armwright.proof.recommendation import NOT_SIMULATED
from armwright.proof.results import read_summary
from armwright.proof.selection import pick
from armwright.proof.simulation_files import SIMULATION
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.sheet.arm_lines import ASSUMED, arm_lines
from armwright.sheet.joint_lines import joint_lines
from armwright.sheet.parts import mass_lines, parts_list
from armwright.sheet.record import DataSheet

SHEET_VALUES = ("backlash", "joint_stiffness")  # of actuators, which a sheet depends on whatever the objectives


def design_sheet(run: Path, number: int | None = None) -> DataSheet:
    """Return the data sheet of a design of a run; by default of the first recommended one, else of the knee.

    Raises:
        FailureError: No number is given, and no design is feasible.
        SettingsError: The run has no such design.
    """
    _, history = read_run(run)
    recommended = (read_summary(run) or {}).get("recommended", ())
    if number is None:
        number = int(recommended[0]["design"]) if recommended else pick(history)[0].number
    member = history.member(number)
    roles = [one for one in recommended if one["design"] == number]
    facts = read_records(run, history, [number])[number].facts
    return sheet_of(history, member, facts, _verdict(run, number, roles))


def sheet_of(history: History, member: FrontMember, facts: Facts, verdict: Mapping[str, str]) -> DataSheet:
    """Return the data sheet of a design; its verdict is role, status and survival, as in `DataSheet`."""
    problem, arm = history.problem, member.arm
    evaluation, payload = history.evaluation([member.number]), float(problem.task.payloads.max())
    lines = arm_lines(arm, payload, evaluation.targets)
    parts, objectives = parts_list(arm, problem.space), zip(problem.objectives, member.values, strict=True)
    return DataSheet(
        name=problem.task.name,
        design=member.number,
        joint_letters=member.design.joints,
        base_position=arm.base,
        base_yaw=0.0,
        **verdict,
        violated=_violated(history, member.number),
        objectives={one.name: (finite_or_none(value), one.unit) for one, value in objectives},
        payload=payload or None,
        facts={**reach_facts(arm, lines["over_reach"][-1]), **facts},
        joints=tuple(joint_lines(arm, evaluation)),
        masses=mass_lines(arm),
        parts=parts,
        assumptions=_assumptions(history, member, payload, [part.part for part in parts if part.price is None]),
        **lines,
    )


def _verdict(run: Path, number: int, roles: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return what a run found about a design; roles: in which it is recommended."""
    if roles:
        status, survival = roles[0]["status"], roles[0]["survival"]
        verdict = "" if survival is None else survival["verdict"]
        return {"role": ", ".join(one["role"] for one in roles), "status": status, "survival": verdict}
    try:
        simulated = json.loads(read_text(run / SIMULATION, MAX_DERIVED, ValueError))["designs"]
        status = next((str(one["verdict"]) for one in simulated if one["design"] == number), NOT_SIMULATED)
    except (ValueError, LookupError, TypeError):  # none, or a damaged file
        status = NOT_SIMULATED
    return {"status": f"{status}; not among the recommended designs"}


def _violated(history: History, number: int) -> tuple[str, ...]:
    """Return the constraints that a design violates, with what it has, or why its evaluation failed."""
    trial = history.trials[number]
    if trial.failure is not None:
        return (f"its evaluation failed: {trial.failure.reason}",)
    return tuple(describe_violated(history.problem.constraints, trial.violations))


def _assumptions(history: History, member: FrontMember, payload: float, unpriced: Sequence[str]) -> dict[str, str]:
    """Return what the values assume, by what they are about."""
    problem, arm = history.problem, member.arm
    found = {
        "masses": problem.space.mass_note,
        "reach": ASSUMED["reach"],
        "errors": f"at the targets of the task, with its payload of {payload:g} kg; static, small displacements; "
        "backlash is the sum of half the play of all joints",
        "over the reach": f"{ASSUMED['over the reach']}; deflection with {payload:g} kg at the tip",
    }
    if any(joint.actuator is not None for joint in arm.joints):
        found["utilisation"] = f"with a safety factor of {arm.safety_factor:g}; motors at the voltage of their supply"
        found["current"] = "positive mechanical power and copper loss; standby current comes on top"
    if assumed := assumed_values(problem, [arm], also=SHEET_VALUES):
        found["actuators"] = f"defaults of their kind or estimates: {describe_assumed(assumed)}"
    if unpriced:
        found["price"] = f"of the parts that state one; not of {', '.join(unpriced)}"
    if problem.evaluator is not None:
        found["objectives"] = "by the custom evaluator of the run; all else by the built-in physics"
    return found

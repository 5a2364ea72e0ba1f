"""Write the folder of each design of the front.

designs/NNNN/arm.urdf     for simulators
designs/NNNN/design.json  its postures, errors and torques at every target
designs/NNNN/arm.xml, trajectory.csv  with a cycle: its model for MuJoCo, and its motion (cycle_export.py)
"""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, TypeVar

from armwright.problem.assumptions import assumed_values
from armwright.problem.evaluation import Evaluation
from armwright.problem.supply import supply_of
from armwright.problem.unreached_reason import unreached_reason
from armwright.proof.cycle_export import cycle_files
from armwright.proof.cycle_faults import path_record
from armwright.robot.arm import Arm
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import RunFolder
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial

T = TypeVar("T")

DESIGNS = "designs"


def write_designs(folder: RunFolder, history: History, verdicts: Mapping[int, Mapping[str, Any]]) -> None:
    """Write the folders of the front's designs, with their verdicts of the verification by number; remove others."""
    names = {design_name(member.number) for member in history.front}
    for stale in (folder.path / DESIGNS).glob("[0-9]*"):
        if stale.name not in names:
            shutil.rmtree(stale)
    if not history.front:
        return
    evaluation = history.evaluation([member.number for member in history.front])
    for row, (member, record) in enumerate(zip(history.front, _design_records(history, evaluation), strict=True)):
        place, name = f"{DESIGNS}/{design_name(member.number)}", f"{history.problem.task.name}-{member.number}"
        folder.write_text(f"{place}/arm.urdf", to_urdf(member.arm, name))
        for file, text in cycle_files(history.problem, member.arm, evaluation, row, name).items():
            folder.write_text(f"{place}/{file}", text)
        if member.number in verdicts:
            record["verification"] = verdicts[member.number]
        folder.write_text(f"{place}/design.json", json.dumps(record, indent=2) + "\n")


def design_name(number: int) -> str:
    """Return the name of a design's folder."""
    return f"{number:04d}"


def _design_records(history: History, evaluation: Evaluation) -> Iterator[dict[str, Any]]:
    """Yield the content of design.json for each design of the front, which was evaluated."""
    for row, member in enumerate(history.front):
        trial = history.trials[member.number]
        assumed, supply = assumed_values(history.problem, [member.arm]), supply_of(evaluation, row)
        yield {
            "number": member.number,
            "source": member.source,
            "reason": trial.reason,
            "params": dict(member.design.params),
            "objectives": objective_record(history, member.values),
            **({"violations": violation_record(history, trial)} if trial.violations else {}),
            "masses": history.problem.space.mass_note,
            **({"assumed": assumed} if assumed else {}),
            **path_record(evaluation, row),
            **({} if supply is None else {"supply": asdict(supply)}),
            "targets": [_target_record(evaluation, row, t, member.arm) for t in range(len(evaluation.targets))],
        }


def _target_record(evaluation: Evaluation, row: int, target: int, arm: Arm) -> dict[str, Any]:
    """Return the posture of an arm, which is row `row` of an evaluation, at a target."""
    angle_error = float(evaluation.angle_error[row, target])
    return {
        "target": evaluation.targets[target].tolist(),
        "q": evaluation.q[row, target, : len(arm.joints)].tolist(),
        "reached": evaluation.reached[row, target].tolist(),
        "position_error": float(evaluation.position_error[row, target]),
        **({"angle_error": angle_error} if evaluation.target_arrays.n_angular[target] else {}),
        "unreached_reason": unreached_reason(arm, evaluation, row, target) or None,
        "joint_torques": evaluation.joint_torques[row, target, : len(arm.joints)].tolist(),
    }


def violation_record(history: History, trial: FinishedTrial) -> dict[str, float]:
    """Return the violations of a trial by constraint."""
    return {c.description: value for c, value in zip(history.problem.constraints, trial.violations, strict=True)}


def objective_record(history: History, values: Sequence[T]) -> dict[str, T]:
    """Return values by objective."""
    return {o.name: value for o, value in zip(history.problem.objectives, values, strict=True)}

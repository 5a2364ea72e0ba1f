"""A design of a run as a file for a simulator or a workshop."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from armwright.exceptions import SettingsError, did_you_mean
from armwright.files import to_csv
from armwright.problem.unreached_reason import unreached_reason
from armwright.robot.build_sheet import SheetRow, sheet_markdown, sheet_rows
from armwright.robot.mjcf import to_mjcf
from armwright.robot.ros2_control import to_ros2_control
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.assumptions import assumed_values, describe_assumed
from armwright.runs.compliance_notes import compliance_notes
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.runs.selection import pick
from armwright.runs.supply_record import supply_of
from armwright.spaces.joint_modules import DIRECTIONS, mounted_vector

OPTUNA = "optuna"  # the format of a whole run (optuna_export.py)
SHEET_VALUES = ("backlash", "joint_stiffness")  # of actuators, which a sheet depends on whatever the objectives


def export_design(run: Path, number: int | None, kind: str) -> str:
    """Return a design of a run in a format; without a number, the knee of its front."""
    if kind not in FORMATS:
        kinds = (*FORMATS, OPTUNA)
        raise SettingsError(f'unknown format "{kind}".{did_you_mean(kind, kinds)} Formats: {", ".join(kinds)}')
    _, history = read_run(run)
    if number is not None and not 0 <= number < len(history):
        raise SettingsError(f"--design {number}: {run} has the designs 0 to {len(history) - 1}")
    member = pick(history)[0] if number is None else history.member(number)
    return FORMATS[kind](history, member)


def _name(history: History, member: FrontMember) -> str:
    return f"{history.problem.task.name}-{member.number}"


def _rows(history: History, member: FrontMember) -> list[SheetRow]:
    evaluation = history.evaluation([member.number])
    return sheet_rows(member.arm, evaluation.q[0], evaluation.joint_torques[0])


def _sheet(history: History, member: FrontMember) -> str:
    task, space = history.problem.task, history.problem.space
    notes = [f"Masses: {space.mass_note}."]
    if task.payloads.any():
        notes.append(f"Torques with the payload of {task.payloads.max():g} kg at most; of the arm alone they are less.")
    up = mounted_vector(DIRECTIONS["+z"], space.mount_of(member.design))
    if up != DIRECTIONS["+z"]:
        shown = ", ".join(f"{value:g}" for value in up)
        notes.append(f"Axes are the world's, with all joints at 0; the arm's own z then points along ({shown}).")
    evaluation = history.evaluation([member.number])
    angle = f" and {np.degrees(evaluation.angle_error.max()):.2f}°" if evaluation.target_arrays.oriented else ""
    notes.append(f"Targets are missed by {1e3 * evaluation.position_error.max():.2f} mm{angle} at most.")
    for target in np.flatnonzero(evaluation.unreached[0]):
        notes.append(f"Target {target + 1} is missed by {unreached_reason(member.arm, evaluation, 0, int(target))}.")
    if supply := supply_of(evaluation, 0):
        notes.append(f"Along the cycle the actuators draw {supply.description}; standby current comes on top.")
    notes += compliance_notes(member.arm, evaluation)
    if assumed := assumed_values(history.problem, [member.arm], also=SHEET_VALUES):
        notes.append(f"Assumed values of actuators, defaults of their kind or estimates: {describe_assumed(assumed)}.")
    return sheet_markdown(_name(history, member), member.arm, _rows(history, member), notes)


def _sheet_csv(history: History, member: FrontMember) -> str:
    rows = [asdict(row) for row in _rows(history, member)]
    for row in rows:
        row["used_low"], row["used_high"] = row.pop("used")
    return to_csv(rows)


FORMATS: dict[str, Callable[[History, FrontMember], str]] = {
    "urdf": lambda history, member: to_urdf(member.arm, _name(history, member)),
    "mjcf": lambda history, member: to_mjcf(member.arm, _name(history, member)),
    "ros2_control": lambda history, member: to_ros2_control(member.arm, _name(history, member)),
    "sheet": _sheet,
    "sheet-csv": _sheet_csv,
}

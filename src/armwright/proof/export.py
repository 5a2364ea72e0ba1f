"""A design of a run as a file for a simulator or a workshop."""

from collections.abc import Callable
from pathlib import Path

from armwright.exceptions import SettingsError, did_you_mean
from armwright.proof.selection import pick
from armwright.robot.arm import Arm
from armwright.robot.mjcf import to_mjcf
from armwright.robot.ros2_control import to_ros2_control
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.folder import read_run

FORMATS: dict[str, Callable[[Arm, str], str]] = {"urdf": to_urdf, "mjcf": to_mjcf, "ros2_control": to_ros2_control}


def export_design(run: Path, number: int | None, kind: str) -> str:
    """Return a design of a run in a format; without a number, the knee of its front."""
    if kind not in FORMATS:
        raise SettingsError(f'unknown format "{kind}".{did_you_mean(kind, FORMATS)} Formats: {", ".join(FORMATS)}')
    _, history = read_run(run)
    member = pick(history)[0] if number is None else history.member(number)
    return FORMATS[kind](member.arm, f"{history.problem.task.name}-{member.number}")

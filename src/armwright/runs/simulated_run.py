"""Simulation of designs of a run folder, and its results there.

simulation.json              the verdicts on the designs that were simulated last
designs/NNNN/simulation.csv  the joints and the tip of a design as they moved
"""

import io
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from armwright.exceptions import SettingsError
from armwright.kinematics.trajectory import PERIOD, Trajectory
from armwright.runs.cycle_export import DIGITS, MODEL, TRAJECTORY, cycle_files, read_trajectory
from armwright.runs.folder import RunFolder
from armwright.runs.history import History
from armwright.runs.results import DESIGNS, design_name
from armwright.runs.simulation import PASS, Drive, Limits, SimulatedDesign, mujoco_version, read_limits, simulate_design
from armwright.runs.simulation_model import TIMESTEP

SIMULATION, MOTION = "simulation.json", "simulation.csv"


@dataclass(frozen=True)
class SimulatedMember:
    """A simulated design of a history.

    Attributes:
        result: The verdict.
        drive: How it moved.
        trajectory: How it should move.
        limits: What its model states.
        files: Content of its model and trajectory, by name.
    """

    result: SimulatedDesign
    drive: Drive
    trajectory: Trajectory
    limits: Limits
    files: dict[str, str]


class Simulator:
    """Simulate designs of a history, each at most once.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        SettingsError: The task has no cycle.
    """

    def __init__(self, history: History) -> None:
        mujoco_version()
        if history.problem.task.cycle is None:
            raise SettingsError(f"task {history.problem.task.name} has no cycle to simulate; try cycle: in_order")
        self.history = history
        self.members: dict[int, SimulatedMember] = {}

    def __call__(self, number: int) -> SimulatedMember:
        """Return a simulated design; SettingsError if a duration of its steps is not known."""
        if number not in self.members:
            self.members[number] = _simulate(self.history, number)
        return self.members[number]


def write_simulated(folder: RunFolder, member: SimulatedMember) -> None:
    """Write the files of a simulated design into its folder."""
    place = f"{DESIGNS}/{design_name(member.result.design)}"
    for name, text in {**member.files, MOTION: _motion_csv(member)}.items():
        folder.write_text(f"{place}/{name}", text)


def simulation_record(members: Iterable[SimulatedMember]) -> dict[str, Any]:
    """Return the content of simulation.json, which `armwright simulate --json` prints."""
    designs = [member.result.record() for member in members]
    return {
        "mujoco": mujoco_version(),
        "timestep": TIMESTEP,
        "feed_forward": True,
        "simulated": len(designs),
        "passed": sum(design["verdict"] == PASS for design in designs),
        "designs": designs,
    }


def _simulate(history: History, number: int) -> SimulatedMember:
    problem, arm = history.problem, history.member(number).arm
    files = dict(cycle_files(problem, arm, history.evaluation([number]), 0, f"{problem.task.name}-{number}"))
    if not files:
        raise SettingsError(
            f"task {problem.task.name} leaves durations of steps open, and the arms have no actuators with known "
            "speeds; try cycle: {time: 1.5, ...}"
        )
    names = problem.task.target_names
    trajectory = read_trajectory(files[TRAJECTORY], names)
    result, drive = simulate_design(number, files[MODEL], trajectory, names)
    return SimulatedMember(result, drive, trajectory, read_limits(files[MODEL]), files)


def _motion_csv(member: SimulatedMember) -> str:
    """Return the simulated joints and tip at the rows of the trajectory as CSV; torques of the drives."""
    drive, trajectory = member.drive, member.trajectory
    n, rows = drive.q.shape[1], len(trajectory.time)
    substeps = round(PERIOD / TIMESTEP)
    tau = drive.tau[np.minimum(np.arange(rows) * substeps, len(drive.tau) - 1)]
    columns = [f"{quantity}_{k}" for quantity in ("q", "qd", "tau") for k in range(1, n + 1)]
    out = io.StringIO()
    out.write(",".join(["time", "step", "tip_x", "tip_y", "tip_z", *columns]) + "\n")
    line = ",".join([f"%.{DIGITS}g"] * (3 + 3 * n)) + "\n"
    for time, step, *values in zip(
        trajectory.time.tolist(),
        trajectory.step.tolist(),
        *np.hstack([drive.tip, drive.q, drive.qd, tau]).T.tolist(),
        strict=True,
    ):
        out.write(f"{time:.{DIGITS}g},{step}," + line % tuple(values))
    return out.getvalue()

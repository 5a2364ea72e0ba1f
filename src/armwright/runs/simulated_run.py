"""Simulation of designs of a run."""

from dataclasses import dataclass

from armwright.exceptions import SettingsError
from armwright.kinematics.trajectory import Trajectory
from armwright.runs.cycle_export import MODEL, TRAJECTORY, cycle_files, read_trajectory
from armwright.runs.history import History
from armwright.runs.simulation import Drive, Limits, SimulatedDesign, mujoco_version, read_limits, simulate_design


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

"""A figure of a simulated cycle: torque and speed of each joint over time, against the limits."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from armwright.arrays import Array
from armwright.pictures.drawing import write_drawn
from armwright.proof.design_record import DESIGNS, design_name
from armwright.proof.results import FIGURES
from armwright.proof.simulated_run import SimulatedMember
from armwright.proof.simulation_model import TIMESTEP
from armwright.robot.arm import Arm

SIMULATED, PLANNED, LIMIT = "#0072B2", "#E69F00", "#D55E00"


def write_simulation_figure(run: Path, arm: Arm, member: SimulatedMember) -> list[Path]:
    """Draw a simulated design into its folder and return the files."""
    place = run / DESIGNS / design_name(member.result.design) / FIGURES
    return write_drawn(place, [("simulation", draw_simulation(arm, member))])


def draw_simulation(arm: Arm, member: SimulatedMember) -> Figure:
    """Draw torque (left) and speed (right) of each joint, simulated and planned."""
    joints = [joint for joint in arm.joints if joint.kind != "fixed"]
    figure = Figure(figsize=(9.0, 1.5 * len(joints) + 0.9), layout="constrained")
    panels: Any = figure.subplots(len(joints), 2, sharex=True, squeeze=False)
    drive, trajectory = member.drive, member.trajectory
    time = np.arange(len(drive.tau), dtype=np.float64) * TIMESTEP
    for k, joint in enumerate(joints):
        slides = joint.kind == "prismatic"
        left, right = panels[k]
        _draw(left, time, drive.tau[:, k], trajectory.time, trajectory.tau[:, k], member.limits.torque[k])
        _draw(right, time, drive.speed[:, k], trajectory.time, trajectory.qd[:, k], joint.speed or np.inf)
        left.set_ylabel(f"joint {k + 1}\n[{'N' if slides else 'N m'}]")
        right.set_ylabel("[m/s]" if slides else "[rad/s]")
    panels[0][0].set_title("torque of the drive")
    panels[0][1].set_title("speed")
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw(panel: Any, time: Array, values: Array, planned_time: Array, planned: Array, limit: float) -> None:
    panel.plot(time, values, color=SIMULATED, linewidth=1.2, label="simulated")
    panel.plot(planned_time, planned, color=PLANNED, linewidth=0.9, linestyle=(0, (4, 2)), label="planned")
    for sign in (-1.0, 1.0) if np.isfinite(limit) else ():
        panel.axhline(sign * limit, color=LIMIT, linewidth=0.9, label="limit" if sign > 0 else None)

"""Files of simulated designs in a run folder.

simulation.json              the verdicts on the designs that were simulated last
designs/NNNN/simulation.csv  the joints and the tip of a design as they moved
"""

import io
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from armwright.kinematics.cycle.trajectory import PERIOD
from armwright.proof.cycle_export import DIGITS
from armwright.proof.design_record import DESIGNS, design_name
from armwright.proof.simulated_run import SimulatedMember
from armwright.proof.simulation import PASS, mujoco_version
from armwright.proof.simulation_model import TIMESTEP
from armwright.runs.folder import RunFolder

SIMULATION, MOTION = "simulation.json", "simulation.csv"


def write_simulated(folder: RunFolder, member: SimulatedMember) -> None:
    """Write the files of a simulated design into its folder."""
    place = f"{DESIGNS}/{design_name(member.result.design)}"
    for name, text in {**member.files, MOTION: _motion_csv(member)}.items():
        folder.write_text(f"{place}/{name}", text)


def simulation_record(members: Iterable[SimulatedMember]) -> dict[str, Any]:
    """Return the content of simulation.json, which `armwright simulate --json` prints."""
    designs = [asdict(member.result) for member in members]
    return {
        "mujoco": mujoco_version(),
        "timestep": TIMESTEP,
        "feed_forward": True,
        "simulated": len(designs),
        "passed": sum(design["verdict"] == PASS for design in designs),
        "designs": designs,
    }


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

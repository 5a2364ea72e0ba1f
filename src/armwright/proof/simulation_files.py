"""Files of simulated designs in a run folder."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from armwright.proof.design_record import DESIGNS, design_name
from armwright.proof.simulated_run import SimulatedMember
from armwright.proof.simulation import PASS, mujoco_version
from armwright.proof.simulation_model import TIMESTEP
from armwright.runs.folder import RunFolder

SIMULATION = "simulation.json"  # the verdicts on the designs that were simulated last


def write_simulated(folder: RunFolder, member: SimulatedMember) -> None:
    """Write the files of a simulated design into its folder."""
    place = f"{DESIGNS}/{design_name(member.result.design)}"
    for name, text in member.files.items():
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

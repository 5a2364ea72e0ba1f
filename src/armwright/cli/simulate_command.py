"""The command that drives designs of a run in a simulator: simulate."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armwright.cli.streams import activity, open_console, print_records
from armwright.cli.tables import Column, print_table
from armwright.exceptions import SettingsError

if TYPE_CHECKING:
    from rich.console import Console

    from armwright.proof.simulation import SimulatedDesign


def simulate(
    run: Path,
    *,
    design: int | None = None,
    all_: bool = False,
    json_: bool = False,
    csv_: bool = False,
) -> None:
    """Drive designs of RUN through their cycle in MuJoCo, and say which pass.

    If a recommended design fails, the next one is tried.

    Parameters:
        design: Number of the design. Default: the recommended designs.
        all_: All designs of the front.
    """
    import json

    from pydantic_core import to_jsonable_python

    from armwright.proof.design_record import read_records
    from armwright.proof.recommendation import recommend
    from armwright.proof.results import SUMMARY, read_summary
    from armwright.proof.simulated_run import Simulator
    from armwright.proof.simulation_files import SIMULATION, simulation_record, write_simulated
    from armwright.runs.folder import RunFolder as Folder
    from armwright.runs.folder import read_run

    if design is not None and all_:
        raise SettingsError("--design and --all choose the designs; use one of them")
    with activity(f"reading {run}"):
        _, history = read_run(run)
    simulator = Simulator(history)
    choice: list[dict[str, Any]] = []
    with activity("simulating"):
        if design is not None:
            simulator(design)
        elif all_:
            for member in history.front:
                simulator(member.number)
        else:
            own = (read_summary(run) or {}).get("recommended", ())
            numbers = dict.fromkeys([*(member.number for member in history.front), *(one["design"] for one in own)])
            survival = {number: one.survival for number, one in read_records(run, history, list(numbers)).items()}
            known = {number: one for number, one in survival.items() if one is not None}
            choice = to_jsonable_python(recommend(history, known, simulator))
    members = [simulator.members[number] for number in sorted(simulator.members)]
    record = simulation_record(members)
    with Folder(run) as folder:
        for member in members:
            write_simulated(folder, member)
        folder.write_text(SIMULATION, json.dumps(record, indent=2) + "\n")
        summary = read_summary(run)
        if choice and summary is not None:
            summary["recommended"] = choice
            folder.write_text(SUMMARY, json.dumps(summary, indent=2) + "\n")
    results = [member.result for member in members]
    if not print_records(json_, csv_, record, map(_row, results)):
        _show(open_console(), run, results, choice)


def _row(one: "SimulatedDesign") -> dict[str, Any]:
    """Return a simulated design as a row of CSV: the worst of its targets [m] and of its joints."""
    ratios = (joint.peak_torque / joint.claimed_peak_torque for joint in one.joints if joint.claimed_peak_torque)
    return {
        "design": one.design,
        "verdict": one.verdict,
        "cycle_time": one.cycle_time,
        "energy": one.energy,
        "tip_error": max((arrival.tip_error for arrival in one.targets), default=0.0),
        "droop": max((arrival.droop for arrival in one.targets), default=0.0),
        "torque_over_claimed": max(ratios, default=0.0),
        "reasons": "; ".join(one.reasons),
    }


def _show(
    console: "Console", run: Path, results: "Sequence[SimulatedDesign]", choice: Sequence[dict[str, Any]]
) -> None:
    from armwright.cli.show_results import show_recommended
    from armwright.proof.simulation import PASS, mujoco_version
    from armwright.proof.simulation_files import SIMULATION

    if not results:
        console.print(f"nothing to simulate: {run} has no feasible design")
        return

    def in_millimetres(error: float) -> str:
        return f"{1e3 * error:.2f}"

    columns = (
        Column("#", "design", str), Column("verdict", "verdict"), Column("cycle [s]", "cycle_time", "{:.2f}".format),
        Column("energy [J]", "energy", "{:.1f}".format), Column("tip error [mm]", "tip_error", in_millimetres),
        Column("without feed-forward [mm]", "droop", in_millimetres),
        Column("peak torque / claimed", "torque_over_claimed", "{:.3f}".format),
    )  # fmt: skip
    print_table(console, columns, map(_row, results))
    for one in results:
        for reason in one.reasons:
            console.print(f"#{one.design}: {reason}")
    show_recommended(console, choice)
    passed = sum(one.verdict == PASS for one in results)
    console.print(f"{passed} of {len(results)} pass in MuJoCo {mujoco_version()}: {run / SIMULATION}")

"""The command that maps in which directions an arm holds its tool: reach-map."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from armwright.cli.arm_options import Tip
from armwright.cli.options import Json
from armwright.cli.streams import open_console, print_json
from armwright.cli.tables import Column, Table, numbers, print_table
from armwright.exceptions import SettingsError

if TYPE_CHECKING:
    from armwright.arrays import Array
    from armwright.kinematics.reach.reach_map import ReachMap
    from armwright.robot.arm import Arm
    from armwright.robot.urdf_reader import UrdfArm
    from armwright.tasks.task import Task

GRID, CONDITIONS = "Grid and directions", "Conditions"


@dataclass(frozen=True)
class _Subject:
    """An arm to map: its name, its task if any, where its files go, without their endings, and the run of a design."""

    name: str
    arm: "Arm | UrdfArm"
    task: "Task | None"
    files: Path
    run: Path | None = None


def reach_map(
    source: Annotated[
        str,
        typer.Argument(metavar="RUN|ARM", help="A run folder, a URDF file, or a name such as ur5e (extra arms)."),
    ],
    design: Annotated[
        int | None, typer.Option(help="Number of the design of RUN.", show_default="the knee of the front")
    ] = None,
    tip: Tip = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            help=r"Distance of neighbouring points \[m].", show_default="about 2,000 points", rich_help_panel=GRID
        ),
    ] = None,
    box: Annotated[
        str | None,
        typer.Option(
            help=r"Smallest, then largest coordinates x,y,z,x,y,z of the points \[m].",
            show_default="all that the tip reaches",
            rich_help_panel=GRID,
        ),
    ] = None,
    axis: Annotated[
        str, typer.Option(help="Middle x,y,z of the cone of tool directions.", rich_help_panel=GRID)
    ] = "0,0,-1",
    cone: Annotated[
        float, typer.Option(help="Half the opening angle of the cone [°]; 180: all directions.", rich_help_panel=GRID)
    ] = 180.0,
    directions: Annotated[int, typer.Option(help="Number of directions.", rich_help_panel=GRID)] = 50,
    share: Annotated[
        float,
        typer.Option(help="Share of directions at a point of the dexterous volume, 0 to 1.", rich_help_panel=GRID),
    ] = 1.0,
    payload: Annotated[
        float | None,
        typer.Option(help=r"Payload at the tip that the motors have to hold \[kg].", rich_help_panel=CONDITIONS),
    ] = None,
    clearance: Annotated[
        float | None,
        typer.Option(help=r"Least distance from the arm itself and from obstacles \[m].", rich_help_panel=CONDITIONS),
    ] = None,
    obstacles: Annotated[
        bool,
        typer.Option("--obstacles", help="Keep clear of the obstacles of the task.", rich_help_panel=CONDITIONS),
    ] = False,
    task: Annotated[
        str | None,
        typer.Option(
            help="The task with the obstacles and targets, for a URDF.", show_default="none", rich_help_panel=CONDITIONS
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The npz file; the figure is beside it.", show_default="RUN/reach-maps/, or this folder"),
    ] = None,
    json_: Json = False,
) -> None:
    """Map in which directions an arm can hold its tool at each point of a grid."""
    from armwright.cli.notes import can_draw
    from armwright.kinematics.reach.reach_map import reach_map
    from armwright.page.page import write_report
    from armwright.page.reach_maps import MOST_POINTS, fingerprint
    from armwright.proof.results import read_summary

    if not 0.0 < share <= 1.0:
        raise SettingsError(f"--share {share}: expected more than 0 and at most 1")
    if out is not None and out.suffix != ".npz":
        raise SettingsError(f"--out {out}: expected a name that ends in .npz")
    subject = _subject(source, design, tip, task)
    if obstacles and (subject.task is None or not subject.task.obstacles):
        where = "a task; try --task TASK" if subject.task is None else "obstacles in the task, which has none"
        raise SettingsError(f"--obstacles: expected {where}")
    if not json_:
        open_console().print(f"mapping the reach of {subject.name} ...")
    found = reach_map(
        subject.arm,
        box=None if box is None else _numbers("--box", box, 6).reshape(2, 3),
        spacing=spacing,
        axis=_numbers("--axis", axis, 3),
        half_angle=math.radians(cone),
        n_directions=directions,
        payload=payload,
        clearance=clearance,
        obstacles=subject.task.obstacles if obstacles and subject.task is not None else (),
    )
    if out is not None:
        subject = replace(subject, files=out.with_suffix(""), run=None)
    subject.files.parent.mkdir(parents=True, exist_ok=True)
    file, figure = (subject.files.with_name(subject.files.name + ending) for ending in (".npz", ".png"))
    conditions = _describe_conditions(payload, clearance, obstacles)
    texts = {"directions_text": _describe_directions(found, axis, cone), "conditions": conditions}
    found.save(file, arm=fingerprint(subject.arm), **texts)
    files = [file]
    if can_draw(open_console(json_)):
        from armwright.pictures.reach_figure import write_reach_figure

        write_reach_figure(found, _surroundings(subject, conditions), share, figure)
        files.append(figure)
    if subject.run is not None and len(found.points) <= MOST_POINTS and read_summary(subject.run) is not None:
        files.append(write_report(subject.run))
    record = {
        "name": subject.name,
        "points": len(found.points),
        "spacing": found.spacing,
        "directions": len(found.directions),
        "axis": _numbers("--axis", axis, 3).tolist(),
        "cone": cone,
        "share": share,
        "conditions": conditions,
        "within_limits": _volumes(found, share, usable=False),
        "usable": _volumes(found, share, usable=True) if conditions else None,
        "files": files,
    }
    if json_:
        print_json(record)
        return
    _show(record)
    if subject.run is not None and len(found.points) > MOST_POINTS:
        open_console().print(f"the report shows maps of up to {MOST_POINTS:,} points")


def _subject(source: str, design: int | None, tip: str | None, task: str | None) -> _Subject:
    """Return the arm of a run or of a URDF."""
    from armwright.proof.selection import pick
    from armwright.robot.robot_descriptions import find_urdf
    from armwright.robot.urdf_reader import read_urdf
    from armwright.runs.folder import REACH_MAPS, read_run
    from armwright.tasks.catalogue import load_task

    if not Path(source).is_dir():
        if design is not None:
            raise SettingsError(f"--design {design} is for a run; {source} is an arm")
        arm = read_urdf(find_urdf(source), tip)
        name = Path(source).stem
        return _Subject(name, arm, None if task is None else load_task(task), Path(f"{name}-reach"))
    for option, value in (("--tip", tip), ("--task", task)):
        if value is not None:
            raise SettingsError(f"{option} {value} is for a URDF; the run {source} has its own")
    _, history = read_run(Path(source))
    if design is not None and not 0 <= design < len(history):
        raise SettingsError(f"--design {design}: {source} has the designs 0 to {len(history) - 1}")
    member = pick(history)[0] if design is None else history.member(design)
    name = f"design {member.number} of {source}"
    return _Subject(
        name, member.arm, history.problem.task, Path(source) / REACH_MAPS / f"{member.number:04d}", Path(source)
    )


def _surroundings(subject: _Subject, conditions: str) -> Any:
    from armwright.pictures.reach_figure import Surroundings

    task = subject.task
    targets = None if task is None else task.target_positions
    return Surroundings(subject.name, subject.arm, conditions, () if task is None else task.obstacles, targets)


def _numbers(option: str, text: str, n: int) -> "Array":
    """Parse numbers with commas."""
    import numpy as np

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != n:
        example = "0,0,-1" if n == 3 else "-0.5,-0.5,0,0.5,0.5,0.8"
        raise SettingsError(f'{option} "{text}": expected {n} numbers with commas, such as {example}')
    return np.array(values)


def _describe_directions(found: "ReachMap", axis: str, cone: float) -> str:
    number = f"{len(found.directions)} directions" if len(found.directions) > 1 else "one direction"
    return f"{number} of the whole sphere" if cone >= 180.0 else f"{number} within {cone:g}° of ({axis})"


def _describe_conditions(payload: float | None, clearance: float | None, obstacles: bool) -> str:
    parts: list[str] = []
    if payload is not None:
        parts.append(f"holding {payload:g} kg")
    if clearance is not None or obstacles:
        away = f" by {1e3 * clearance:g} mm" if clearance else ""
        parts.append(f"clear of itself{' and obstacles' if obstacles else ''}{away}")
    return ", ".join(parts)


def _volumes(found: "ReachMap", share: float, usable: bool) -> dict[str, float]:
    coverage = found.usable if usable else found.bare
    return {
        "volume": coverage.volume,
        "dexterous_volume": coverage.dexterous_volume(share),
        "poses": float(coverage.reached.mean()),
    }


def _show(record: dict[str, Any]) -> None:
    console = open_console()
    console.print(f"{record['points']:,} points {record['spacing']:.3g} m apart, {record['directions']} directions")
    share = "all directions" if record["share"] >= 1.0 else f">= {100 * record['share']:g} % of directions"
    columns = (Column("postures", least=24), *numbers("reached [m³]", f"in {share} [m³]", "poses [%]"))
    conditions = {"within joint limits": record["within_limits"], record["conditions"]: record["usable"]}
    rows = [
        (name, f"{values['volume']:.3g}", f"{values['dexterous_volume']:.3g}", f"{100 * values['poses']:.1f}")
        for name, values in conditions.items()
        if values is not None
    ]
    print_table(console, Table(columns, rows, "--json prints all"))
    for file in record["files"]:
        console.print(str(file))

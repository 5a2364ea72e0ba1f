"""The command that maps in which directions an arm holds its tool: reach-map."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from armwright.cli.options import parse_numbers, refuse
from armwright.cli.streams import open_console, print_json
from armwright.cli.tables import Column, print_table
from armwright.exceptions import SettingsError
from armwright.text import percent, rounded

if TYPE_CHECKING:
    from armwright.pictures.mapped_arm import MappedArm


def reach_map(
    source: str,
    *,
    design: int | None = None,
    tip: str | None = None,
    spacing: float | None = None,
    box: str | None = None,
    axis: str = "0,0,-1",
    cone: float = 180.0,
    directions: int = 50,
    payload: float | None = None,
    clearance: float | None = None,
    obstacles: bool = False,
    task: str | None = None,
    out: Path | None = None,
    json_: bool = False,
) -> None:
    """Map in which directions an arm can hold its tool at each point of a grid.

    Parameters:
        source (RUN|ARM): A run folder, a URDF file, or a name such as ur5e (extra arms).
        design: Number of the design of RUN. Default: the knee of the front.
        out: The npz file; the figure is beside it. Default: RUN/reach-maps/, or this folder.

    Grid and directions:
        spacing: Distance of neighbouring points [m]. Default: about 2,000 points.
        box: Smallest, then largest coordinates x,y,z,x,y,z of the points [m]. Default: all that the tip reaches.
        axis: Middle x,y,z of the cone of tool directions.
        cone: Half the opening angle of the cone [°]; 180: all directions.
        directions: Number of directions.

    Conditions:
        payload: Payload at the tip that the motors have to hold [kg].
        clearance: Least distance from the arm itself and from obstacles [m].
        obstacles: Keep clear of the obstacles of the task.
        task: The task with the obstacles and targets, for a URDF. Default: none.
    """
    from armwright.cli.notes import can_draw
    from armwright.kinematics.reach.reach_map import reach_map

    if out is not None and out.suffix != ".npz":
        raise SettingsError(f"--out {out}: expected a name that ends in .npz")
    middle = parse_numbers("--axis", axis, "three numbers with commas, such as 0,0,-1", 3)
    corners = "six numbers with commas, such as -0.5,-0.5,0,0.5,0.5,0.8"
    numbers = None if box is None else parse_numbers("--box", box, corners, 6)
    mapped, file = _subject(source, design, tip, task, _describe_conditions(payload, clearance, obstacles))
    if obstacles and not mapped.obstacles:
        where = "a task; try --task TASK" if mapped.task is None else "obstacles in the task, which has none"
        raise SettingsError(f"--obstacles: expected {where}")
    console = open_console(json_)
    if not json_:
        for line in filter(None, (mapped.read, f"mapping the reach of {mapped.title} ...")):
            console.print(line)
    found = reach_map(
        mapped.arm,
        box=None if numbers is None else (numbers[:3], numbers[3:]),
        spacing=spacing,
        axis=middle,
        half_angle=math.radians(cone),
        n_directions=directions,
        payload=payload,
        clearance=clearance,
        obstacles=mapped.obstacles if obstacles else (),
    )
    file = out or file
    file.parent.mkdir(parents=True, exist_ok=True)
    around = "of the whole sphere" if cone >= 180.0 else f"within {cone:g}° of ({axis})"
    count = f"{len(found.directions)} directions" if len(found.directions) > 1 else "one direction"
    texts = {"directions_text": f"{count} {around}", "conditions": mapped.conditions}
    found.save(file, **texts)
    files = [file]
    if can_draw(open_console(json_)):
        from armwright.pictures.reach_figure import write_reach_figure

        files.append(file.with_suffix(".png"))
        write_reach_figure(found, mapped, files[1])
    coverages = {"within joint limits": found.bare}
    if mapped.conditions:
        coverages[mapped.conditions] = found.usable
    volumes = [
        {
            "postures": name,
            "volume": coverage.volume,
            "dexterous_volume": coverage.dexterous_volume(),
            "poses": float(coverage.reached.mean()),
        }
        for name, coverage in coverages.items()
    ]
    if json_:
        print_json(
            {
                "name": mapped.title,
                "points": len(found.points),
                "spacing": found.spacing,
                "directions": len(found.directions),
                "axis": middle,
                "cone": cone,
                "conditions": mapped.conditions,
                "within_limits": volumes[0],
                "usable": volumes[1] if mapped.conditions else None,
                "files": files,
            }
        )
        return
    console.print(f"{len(found.points):,} points {rounded(found.spacing)} m apart, {len(found.directions)} directions")
    columns = (
        Column("postures", "postures", least=24), Column("reached [m³]", "volume", rounded),
        Column("in all directions [m³]", "dexterous_volume", rounded),
        Column("poses", "poses", lambda share: percent(share, 1)),
    )  # fmt: skip
    print_table(console, columns, volumes, "--json prints all")
    for written in files:
        console.print(str(written))


def _subject(
    source: str, design: int | None, tip: str | None, task: str | None, conditions: str
) -> "tuple[MappedArm, Path]":
    """Return the arm of a run or of a URDF, and the file of its map."""
    from armwright.pictures.mapped_arm import MappedArm
    from armwright.proof.selection import pick
    from armwright.robot.robot_descriptions import find_urdf
    from armwright.robot.urdf_reader import read_urdf
    from armwright.runs.folder import REACH_MAPS, read_run
    from armwright.tasks.catalogue import load_task

    run = Path(source)
    if not run.is_dir():
        refuse(f" is for a run; {source} is an arm", design=design)
        described, around = read_urdf(find_urdf(source), tip), None if task is None else load_task(task)
        read = f"{run.stem}: {described.notes[0]}"
        return MappedArm(run.stem, described.arm, around, conditions, read), Path(f"{run.stem}-reach.npz")
    refuse(f" is for a URDF; the run {source} has its own", tip=tip, task=task)
    _, history = read_run(run)
    member = pick(history)[0] if design is None else history.member(design)
    title = f"design {member.number} of {source}"
    file = run / REACH_MAPS / f"{member.number:04d}.npz"
    return MappedArm(title, member.arm, history.problem.task, conditions), file


def _describe_conditions(payload: float | None, clearance: float | None, obstacles: bool) -> str:
    parts: list[str] = []
    if payload is not None:
        parts.append(f"holding {payload:g} kg")
    if clearance is not None or obstacles:
        away = f" by {1e3 * clearance:g} mm" if clearance else ""
        parts.append(f"clear of itself{' and obstacles' if obstacles else ''}{away}")
    return ", ".join(parts)

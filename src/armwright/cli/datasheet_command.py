"""The command that writes data sheets of designs and of existing arms: datasheet."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armwright.cli.activity import activity
from armwright.cli.arm_options import BaseLink, BasePose, Tip, parse_base, parse_price
from armwright.cli.options import TASK, Json, SpaceFile
from armwright.cli.streams import print_json, print_text
from armwright.exceptions import SettingsError

if TYPE_CHECKING:
    from armwright.robot.urdf_reader import UrdfArm
    from armwright.sheet.record import DataSheet


def datasheet(
    source: Annotated[
        str,
        typer.Argument(
            metavar="RUN|ARM",
            help="A run folder, a URDF file, or a name such as ur5e (robot_descriptions; extra arms).",
        ),
    ],
    design: Annotated[
        int | None,
        typer.Option(help="Number of the design of the run.", show_default="the first recommended one"),
    ] = None,
    actuators: Annotated[
        str | None,
        typer.Option(
            metavar="JOINT=NAME,...",
            help="Actuators of the catalogue at joints of the URDF, by name or number.",
            show_default="the efforts of the URDF",
        ),
    ] = None,
    task: Annotated[
        str | None,
        typer.Option(help="The task of an arm that exists.", show_default="none", rich_help_panel=TASK),
    ] = None,
    space: SpaceFile = None,
    base: BasePose = None,
    price: Annotated[str | None, typer.Option(metavar="USD", help="Price of an arm that exists.")] = None,
    tip: Tip = None,
    base_link: BaseLink = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the base search.", show_default="0")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Output folder.", show_default="designs/NNNN of the run, or NAME-datasheet"),
    ] = None,
    json_: Json = False,
) -> None:
    """Write the data sheet of a design of RUN or of an existing arm as JSON, and as HTML that prints on A4."""
    from armwright.proof.design_record import DESIGNS, design_name
    from armwright.robot.robot_descriptions import find_urdf
    from armwright.robot.urdf_reader import read_urdf
    from armwright.sheet.design_sheet import design_sheet
    from armwright.sheet.writer import sheet_record, write_datasheet

    if Path(source).is_dir():
        of_urdf = {"--actuators": actuators, "--task": task, "--space": space, "--base": base, "--price": price,
                   "--tip": tip, "--base-link": base_link, "--seed": seed}  # fmt: skip
        for option, value in of_urdf.items():
            if value is not None:
                raise SettingsError(f"{option} {value}: expected a URDF, got the run {source}, which has its own arms")
        with activity("writing the data sheet"):
            sheet = design_sheet(Path(source), design)
        folder = Path(source) / DESIGNS / design_name(sheet.design or 0)
    else:
        if design is not None:
            raise SettingsError(f"--design {design}: expected a run folder, got {source}")
        for option, value in (("--space", space), ("--base", base)):
            if value is not None and task is None:
                raise SettingsError(f"{option} {value}: expected a task, too; try --task TASK")
        with activity("placing the arm" if task and base is None else "writing the data sheet"):
            described = read_urdf(find_urdf(source), tip, base_link)
            sheet = _sheet_of_urdf(described, actuators, task, space, base, price, seed or 0)
        folder = Path(f"{Path(source).stem}-datasheet")
    files = write_datasheet(sheet, folder if out is None else out)
    if json_:
        print_json(sheet_record(sheet))
        return
    for file in files:
        print_text(str(file))


def _sheet_of_urdf(
    described: "UrdfArm",
    actuators: str | None,
    task: str | None,
    space: Path | None,
    base: str | None,
    price: str | None,
    seed: int,
) -> "DataSheet":
    """Return the data sheet of an arm, in its place on a task if one is named."""
    from armwright.cli.options import load_problem
    from armwright.existing.base_placement import placed
    from armwright.sheet.urdf_sheet import Job, driven, read_actuators, urdf_sheet

    named = {} if actuators is None else read_actuators(actuators, described.joints)
    described, stated = driven(described, named), None if price is None else parse_price(price)
    if task is None:
        return urdf_sheet(described, named, price=stated)
    problem = load_problem(task, space)
    placement = placed(problem, described, seed, parse_base(base))
    return urdf_sheet(placement.described, named, Job(problem, placement.mounting, placement.description), stated)

"""The command that writes data sheets of designs and of existing arms: datasheet."""

from pathlib import Path
from typing import Annotated

import typer

from armwright.cli.options import Json
from armwright.cli.streams import print_json
from armwright.exceptions import SettingsError


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
    tip: Annotated[str | None, typer.Option(help="Link of the URDF at the tip.", show_default="the last one")] = None,
    base_link: Annotated[
        str | None, typer.Option(help="Link of the URDF at the base.", show_default="the root")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Output folder.", show_default="designs/NNNN of the run, or NAME-datasheet"),
    ] = None,
    json_: Json = False,
) -> None:
    """Write the data sheet of a design of RUN, or of an arm that exists, as HTML, PDF of two pages, and JSON."""
    from armwright.report.datasheet import sheet_record, write_datasheet
    from armwright.robot.robot_descriptions import find_urdf
    from armwright.robot.urdf_reader import read_urdf
    from armwright.runs.datasheet.design_sheet import design_sheet
    from armwright.runs.datasheet.urdf_sheet import read_actuators, urdf_sheet
    from armwright.runs.design_folders import DESIGNS, design_name

    if Path(source).is_dir():
        for option, value in (("--actuators", actuators), ("--tip", tip), ("--base-link", base_link)):
            if value is not None:
                raise SettingsError(f"{option} {value}: expected a URDF, got the run {source}, which has its own arms")
        sheet = design_sheet(Path(source), design)
        folder = Path(source) / DESIGNS / design_name(sheet.design or 0)
    else:
        if design is not None:
            raise SettingsError(f"--design {design}: expected a run folder, got {source}")
        described = read_urdf(find_urdf(source), tip, base_link)
        named = {} if actuators is None else read_actuators(actuators, described.joints)
        sheet = urdf_sheet(described, named)
        folder = Path(f"{Path(source).stem}-datasheet")
    files = write_datasheet(sheet, folder if out is None else out)
    if json_:
        print_json(sheet_record(sheet))
        return
    for file in files:
        print(file)

"""The command that writes data sheets of designs and of existing arms: datasheet."""

from pathlib import Path

from armwright.cli.options import load_problem, parse_base, refuse
from armwright.cli.streams import activity, print_json, print_text


def datasheet(
    source: str,
    *,
    design: int | None = None,
    task: str | None = None,
    space: Path | None = None,
    base: str | None = None,
    price: float | None = None,
    tip: str | None = None,
    base_link: str | None = None,
    seed: int | None = None,
    out: Path | None = None,
    json_: bool = False,
) -> None:
    """Write the data sheet of a design of RUN or of an existing arm as JSON, and as HTML that prints on two pages.

    Parameters:
        source (RUN|ARM): A run folder, a URDF file, or a name such as ur5e (robot_descriptions; extra arms).
        design: Number of the design of the run. Default: the first recommended one.
        price (USD): Price of an arm that exists.
        seed: Seed of the base search. Default: 0.
        out: Output folder. Default: designs/NNNN of the run, or NAME-datasheet.

    Task:
        task: The task of an arm that exists. Default: none.
    """
    from armwright.proof.design_record import DESIGNS, design_name
    from armwright.sheet.design_sheet import design_sheet
    from armwright.sheet.writer import sheet_record, write_datasheet

    read = ""
    if Path(source).is_dir():
        reason = f": expected a URDF, got the run {source}, which has its own arms"
        refuse(reason, task=task, space=space, base=base, price=price, tip=tip, base_link=base_link, seed=seed)
        with activity("writing the data sheet"):
            sheet = design_sheet(Path(source), design)
        folder = Path(source) / DESIGNS / design_name(sheet.design or 0)
    else:
        from armwright.existing.base_placement import placed
        from armwright.robot.robot_descriptions import find_urdf
        from armwright.robot.urdf_reader import read_urdf
        from armwright.sheet.urdf_sheet import urdf_sheet

        refuse(f": expected a run folder, got {source}", design=design)
        if task is None:
            refuse(": expected a task, too; try --task TASK", space=space, base=base)
        with activity("placing the arm" if task and base is None else "writing the data sheet"):
            described = read_urdf(find_urdf(source), tip, base_link)
            place = None if task is None else placed(load_problem(task, space), described, seed or 0, parse_base(base))
            sheet, read = urdf_sheet(place or described, price), f"{described.name}: {described.notes[0]}"
        folder = Path(f"{Path(source).stem}-datasheet")
    files = write_datasheet(sheet, folder if out is None else out)
    if json_:
        print_json(sheet_record(sheet))
        return
    for line in filter(None, (read, *files)):
        print_text(str(line))

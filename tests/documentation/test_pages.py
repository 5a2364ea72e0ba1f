"""Run the commands and programs of the documentation, and load its files.

Commands that cannot run here are listed in NOT_RUN with the reason; their options are still checked.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

import armwright as aw
from armwright.cli.app import app
from armwright.experiments.cells import plan_cells
from armwright.experiments.plan import ExperimentPlan, load_experiment
from armwright.llm.configuration import load_model_options
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from tests import ROOT
from tests.support import command_line
from tests.support.arms import LIGHT
from tests.support.documentation import PAGES, Block, Command, blocks, code_spans, commands, sections
from tests.support.robots import robot

# Commands that are not run, by what they match as a whole; the first that matches counts.
NOT_RUN = {
    r"make .*": "installs from a network, and some take half an hour; that Makefile has the target is checked",
    r"python3 -m venv .*|\. \.venv/bin/activate": "the tests run in an environment already",
    r"(\S*python -m )?pip install .*": "installs from a network; that the extras exist is checked",
    r"export \w+=.*": "a key of nobody's",
    r"armwright experiment .*--model .*": "needs a model's key",
    r"armwright .*--model .*": "needs a model; test_llm.py and test_draft.py run such against a server of their own",
    r"armwright .*--proposer replay:.*": "needs a run that a model was asked in; test_replay.py makes one",
    r"armwright .*--proposer manual:.*": "waits for people; test_manual.py answers",
    r"armwright edit .*": "serves until Ctrl-C; tests/editor follows its page",
    r"armwright compare-arms .* ur5e panda .*": "robot_descriptions fetches these arms from a network",
    r"armwright optimize .*--scheduler .*|dask .*": "needs a cluster on other machines; test_dask.py starts one",
    r"python -m (tests\.fuzz|pytest) .*": "minutes to hours; the suite has a short form of both",
    r"python benchmarks/.*": "half an hour of benchmark; docs/benchmarks.md has the figures",
}
# Experiments of minutes to hours: all of their cells are made and none is run.
LONG = re.compile(r"armwright experiment (paper|recorded|rules|n-step|samplers|suite|mine\.yaml)( --(model|seed) .+)?")
# Pages whose programs are run elsewhere, where what comes of them is looked at, too.
PROGRAMS_RUN_IN = {"README.md": "test_public.py", "docs/optuna.md": "test_examples.py"}

FOLLOWED = [page for page in PAGES if commands(page) or any(block.language == "python" for block in blocks(page))]
# Slow pages with independent sections; each section is tested separately.
BY_SECTION = ("docs/examples.md",)
FEW = "1000"  # evaluations of a search
RARE = {
    "3-long-shelf": "4000",
    "5-obstacle": "2000",
    "8-stiffness": "2000",
    "feeder": "3000",
}  # where few designs are feasible
MAX_WAIT = 900.0  # [s] for a command; only one that waits forever takes this long

# What a page takes for granted. Short runs will do: a page says what to do with a run, not how it was made.
SHORT = "--n-total 40 --no-figures"
POINTS = {"points.csv": "x,y,z\n400,-200,100\n400,200,100\n100,350,500\n"}
FILES = {
    "docs/tasks.md": POINTS,
    "docs/spaces.md": {
        "mine.yaml": "name: mine\ntargets: [[0.3, 0.0, 0.2], [0.2, 0.2, 0.3]]\n",
        "space.yaml": "joints: 2\njoint_types: [Y, P]\n",
        "arm.json": '{"params": {"origin_x": 0.0, "origin_y": 0.0, "origin_z": 0.0, "joint_1": "Y", "joint_2": "P", '
        '"link_1": 0.2, "link_2": 0.25}}',
    },
    "docs/experiments.md": {"shelf.yaml": "name: rack\ntargets: [[0.3, 0.0, 0.2]]\n", "six-axis.yaml": "joints: 6\n"},
}  # fmt: skip
BEFORE = {
    "docs/inverse-kinematics.md": [f"armwright optimize target-1 {SHORT} --out runs/mine",
                                   "armwright export runs/mine --out my-arm.urdf"],
    "docs/exports.md": [f"armwright optimize target-1 {SHORT}"],
    "docs/page.md": [f"armwright optimize target-1 {SHORT} --out runs/{name}" for name in "ab"],
    "docs/language-models.md": [f"armwright optimize target-1 {SHORT} --out runs/mine"],
    "docs/experiments.md": [f"armwright optimize target-1 --proposer {proposer} {SHORT} --out runs/{name}"
                            for name, proposer in (("a", "none"), ("b", "rules"), ("others/c", "rules --seed 1"))],
}  # fmt: skip


def cli() -> dict[str, Any]:
    """Return Typer's commands by name."""
    return dict(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def reason_not_to_run(command: str) -> str:
    return next((reason for pattern, reason in NOT_RUN.items() if re.fullmatch(pattern, command)), "")


def parsed(arguments: Sequence[str]) -> None:
    """Parse the arguments of a command without running it."""
    name, *rest = arguments
    assert name in cli(), f"there is no command {name}"
    cli()[name].make_context(f"armwright {name}", list(rest))


@pytest.mark.parametrize("page", FOLLOWED)
@pytest.mark.fast_cases(3)
def test_documented_commands_and_options_exist(page: str) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for command in commands(page):
        program, *arguments = shlex.split(command.text.split(" > ")[0].split(" < ")[0])
        match Path(program).name:
            case "armwright":
                parsed(arguments)
            case "make":
                assert {a for a in arguments if "=" not in a} <= targets, command.where
            case "python" | "python3" if arguments[0].endswith(".py"):
                assert (ROOT / arguments[0]).is_file(), command.where
            case "pip" | "python" | "python3" if "install" in arguments:
                for name in re.findall(r"\[([\w,]+)\]", command.text):
                    assert set(name.split(",")) <= extras.keys(), command.where
                assert all((ROOT / arguments[i + 1]).is_file() for i, a in enumerate(arguments) if a == "-c")
            case _:
                run = reason_not_to_run(command.text) or shutil.which(program)
                assert run, f"{command.where}: {command.text} can neither be run, nor is it excused"


def test_every_excuse_matches_a_documented_command() -> None:
    shown = [command.text for page in PAGES for command in commands(page)]
    for pattern in NOT_RUN:
        assert any(re.fullmatch(pattern, command) for command in shown), pattern
    for page, file in PROGRAMS_RUN_IN.items():
        assert Path(page).name in next((ROOT / "tests").rglob(file)).read_text(encoding="utf-8"), page


def test_options_named_in_sentences_exist() -> None:
    """`armwright design`, `--budget` and the like within sentences."""
    options = {
        name: {o for p in command.params for o in (*p.opts, *p.secondary_opts)} for name, command in cli().items()
    }
    scripts = "".join(
        file.read_text(encoding="utf-8") for place in ("benchmarks", "tests") for file in (ROOT / place).rglob("*.py")
    )
    ours = set(re.findall(r'add(?:_argument|option)\(\s*"(--[a-z-]+)"', scripts))
    known = set[str]().union(*options.values()) | {"--version", "--help"} | ours
    checked = 0
    for page in PAGES:
        for span in code_spans(page):
            words = span.split()
            checked += words[0] == "armwright" or words[0].startswith("--")
            said = {word.split("=")[0] for word in words if re.fullmatch(r"--[a-z][a-z-]+(=.*)?", word)}
            if words[0] == "armwright" and len(words) > 1 and not words[1].startswith("-"):
                assert words[1] in options, f"{page}: {span}"
                assert said <= options[words[1]] | {"--help"}, f"{page}: {span}"
            elif words[0].startswith("--"):
                assert said <= known, f"{page}: {span}"
    assert checked > 100


def test_files_named_in_sentences_exist() -> None:
    named = [
        (page, span)
        for page in PAGES
        for span in code_spans(page)
        if re.fullmatch(r"(src|tests|benchmarks|examples|tools|optunahub)/[\w./-]+", span)
    ]
    assert len(named) > 20
    assert [(page, span) for page, span in named if not (ROOT / span).exists()] == []


def shell(line: str, folder: Path, where: str) -> str:
    """What a line prints that a user types in a folder; a command of armwright alone runs in this process."""
    if re.fullmatch(r"armwright [^|&;<>$`*?~\\]*", line):
        done = command_line.armwright(*shlex.split(line)[1:])
    else:
        program = folder / ".bin" / "armwright"
        program.parent.mkdir(exist_ok=True)
        program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m armwright "$@"\n', encoding="utf-8")
        program.chmod(0o755)
        path = os.pathsep.join([str(program.parent), str(Path(sys.executable).parent), os.environ["PATH"]])
        done = subprocess.run(
            ["bash", "-c", line],
            env={**os.environ, "PATH": path, "PYTHONWARNINGS": "error"},
            capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=MAX_WAIT, encoding="utf-8",
        )  # fmt: skip
    assert done.returncode == 0, f"{where}: {line}\n{done.stdout}{done.stderr}"
    assert "Traceback" not in done.stderr, f"{where}: {line}\n{done.stderr}"
    return done.stdout


def planned(experiment: str) -> None:
    """Check that an experiment has cells."""
    plan, beside = load_experiment(shlex.split(experiment)[2])
    cells, skipped = plan_cells(plan, beside, Path("out"))
    assert len(cells) + len(skipped) > 20


EXPERIMENTS = {command.text for page in PAGES for command in commands(page) if LONG.fullmatch(command.text)}


def test_long_experiments_can_be_planned() -> None:
    for experiment in {one for one in EXPERIMENTS if "mine.yaml" not in one}:
        planned(experiment)


def shortened(text: str) -> str:
    """The command with a search no longer than needed, and without figures, which README.md's commands draw."""
    if text.startswith("armwright experiment"):
        return re.sub(r"--seeds \d+", "--seeds 1", text)
    if text.startswith("armwright simulate"):
        return text.removesuffix(" --all")
    if not re.match(r"armwright (optimize|design) ", text):
        return text
    text = re.sub(r"--budget \w+", "--budget 1s", text)
    enough = next((number for name, number in RARE.items() if name in text), FEW)
    text = re.sub(r"--evaluations \d+", f"--evaluations {enough}", text)
    if "armwright design" in text and not re.search(r"--(evaluations|budget) ", text):
        text = f"{text} --evaluations {FEW}"
    text = re.sub(r"--n-total 1\d\d", "--n-total 60", text)
    if "--evaluator" in text and "--n-total" not in text:
        text = f"{text} --n-total 20"
    return f"{text} --no-figures"


def run_command(command: Command, folder: Path) -> str:
    """Return what a command prints, or writes to the file it names."""
    text = command.text.replace(".venv/bin/", "")
    text = text if command.where.startswith("README.md") else shortened(text)
    if LONG.fullmatch(text):
        if "mine.yaml" in text:  # the others are planned once for all pages
            planned(text)
    elif not reason_not_to_run(command.text):
        printed = shell(text, folder, command.where)
        out = re.search(r"--out (\S+)", text)
        written = out is not None and (folder / out[1]).is_file()
        return (folder / out[1]).read_text(encoding="utf-8") if out is not None and written else printed
    return ""


def letters(text: str) -> str:
    """Return the letters of an output, which do not depend on the processor."""
    return " ".join(re.findall(r"[A-Za-z]+", text))


def file_of(block: Block) -> str | None:
    """Return the file name that the paragraph before a block states."""
    before = "\n".join((ROOT / block.page).read_text(encoding="utf-8").splitlines()[: block.line - 1]).rstrip()
    found = re.search(r"`([\w-]+\.\w+)`:$", before)
    return found[1] if found else None


FOLLOWED_BY_SECTION = {
    f"{page}, {section}": (page, own)
    for page in BY_SECTION
    for section, own in sections(page).items()
    if any(block.language in ("sh", "python") for block in own)
}


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in FOLLOWED if page not in BY_SECTION])
def test_page_can_be_followed(page: str, in_folder: Path) -> None:
    follow(page, blocks(page), in_folder)


@pytest.mark.slow
@pytest.mark.parametrize("section", FOLLOWED_BY_SECTION)
def test_section_can_be_followed(section: str, in_folder: Path) -> None:
    follow(*FOLLOWED_BY_SECTION[section], in_folder)


def follow(page: str, shown: Sequence[Block], in_folder: Path) -> None:
    """Run commands and programs and write files in order, in one folder."""
    shutil.copytree(ROOT / "examples", in_folder / "examples")
    for name, file in (("ur3", "ur3_robot"), ("so101", "so101")):
        shutil.copy(robot(file), in_folder / f"{name}.urdf")
    for name, text in FILES.get(page, {}).items():
        (in_folder / name).write_text(text, encoding="utf-8")
    for line in BEFORE.get(page, ()):
        shell(line, in_folder, page)
    run = {command.where: command for command in commands(page)}
    said = ""  # by what was run last
    for block in shown:
        for number in range(len(block.text.splitlines()) + 1):
            command = run.get(f"{page}:{block.line + number}")
            if command is not None:
                said = run_command(command, in_folder)
        if block.language in ("yaml", "csv", "python") and (name := file_of(block)):
            (in_folder / name).write_text(block.text, encoding="utf-8")
        if block.language == "python" and page not in PROGRAMS_RUN_IN:
            (in_folder / "program.py").write_text(block.text, encoding="utf-8")
            said = shell("python program.py", in_folder, block.where)
        if block.language == "text":
            assert letters(block.text.splitlines()[0]) in letters(said), block.where


@pytest.mark.parametrize(
    "block", [b for page in PAGES for b in blocks(page) if b.language == "yaml"], ids=lambda b: b.where
)
def test_files_shown_on_a_page_load(block: Block, in_folder: Path) -> None:
    content = yaml.safe_load(block.text)
    for name, text in FILES.get("docs/experiments.md", {}).items():
        (in_folder / name).write_text(text, encoding="utf-8")
    file = in_folder / "shown.yaml"
    if "methods" in content:
        file.write_text(block.text, encoding="utf-8")
        plan, beside = load_experiment("shown.yaml")
        cells, skipped = plan_cells(plan, beside, in_folder / "out")
        assert len(cells) + len(skipped) == len(plan.task_list) * sum(len(plan.seeds_of(key)) for key in plan.methods)
    elif content.keys() <= aw.ModelOptions.model_fields.keys():
        file.write_text(block.text, encoding="utf-8")
        assert load_model_options("shown.yaml").given == content
    elif content.keys() & (Task.model_fields.keys() - DesignSpace.model_fields.keys()):
        named = "" if "name" in content else "name: shown\n"  # a part of a file
        some = "" if {"targets", "workspace"} & content.keys() else "targets: [[0.3, 0.0, 0.2]]\n"
        file.write_text(named + some + block.text, encoding="utf-8")
        space = DesignSpace.model_validate({"actuators": ["XL430-W250"], "joints": 3, **LIGHT})
        problem = aw.Problem(aw.load_task("shown.yaml"), space)
        assert len(problem.evaluate(problem.space.sample(2, 0)).values) == 2
    else:
        file.write_text(block.text, encoding="utf-8")
        assert aw.load_space("shown.yaml").parameters


def test_every_code_block_has_a_tested_language() -> None:
    """Printed output is text; formulas and drawings have no language."""
    for page in PAGES:
        for block in blocks(page):
            assert block.language in ("sh", "yaml", "csv", "python", "jinja", "text", ""), block.where
            formulas = page in ("docs/method.md", "docs/architecture.md")
            assert block.language or formulas, f"{block.where}: a block of no language"


def test_keys_of_an_experiment_method_are_options() -> None:
    """The reference documents them by the help of `armwright optimize`."""
    options = {parameter.name for parameter in cli()["optimize"].params}
    assert set(ExperimentPlan.model_fields["methods"].annotation.__args__[1].model_fields) <= options | {
        "label",
        "design",
        "seeds",
        "against",
    }  # type: ignore[union-attr]

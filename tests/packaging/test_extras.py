"""Missing extras are reported in one line with the install command."""

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest

import armwright as aw
from armwright import extras
from armwright.editor.edited_files import EditedFiles
from armwright.editor.server import serve_editor
from armwright.exceptions import MissingExtraError, UsageError
from armwright.extras import DISTRIBUTIONS, EXTRAS, missing_packages, naming_extras
from armwright.robot.robot_descriptions import find_urdf
from tests import ROOT
from tests.support.extras import NEEDS_GP

STATED: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]


def plain(name: str) -> str:
    """A requirement's distribution, as PyPI writes it."""
    return re.sub("[-_.]+", "-", re.split(r"[\[<>=!~ ]", name)[0]).lower()


def distributions(extra: str) -> list[str]:
    """The distributions of an extra."""
    return [DISTRIBUTIONS.get(package, package) for package in EXTRAS[extra]]


def test_extras_match_pyproject() -> None:
    bring_studies = {extra for extra in STATED if "armwright[studies]" in STATED[extra]}
    assert bring_studies == {"distributed", "gp", "llm"}
    stated = {
        extra: [requirement for requirement in requirements if requirement != "armwright[studies]"]
        for extra, requirements in STATED.items()
        if extra != "all"
    }
    assert set(EXTRAS) == set(stated)
    assert STATED["all"] == [f"armwright[{','.join(sorted(stated))}]"]
    assert re.match(r"pydantic-ai-slim\[anthropic,google,openai\]", *stated["llm"])  # which brings their packages
    assert distributions("llm") == ["anthropic", "google-genai", "openai", "pydantic-ai-slim"]
    for extra in set(EXTRAS) - {"llm"}:
        assert {plain(name) for name in distributions(extra)} == {plain(name) for name in stated[extra]}


@cache
def holders() -> Mapping[str, list[str]]:
    """The distributions that hold each package installed here."""
    return metadata.packages_distributions()


@pytest.mark.parametrize("extra", [pytest.param(one, marks=NEEDS_GP if one == "gp" else ()) for one in EXTRAS])
def test_packages_of_an_extra_belong_to_its_distributions(extra: str) -> None:
    installed = set(EXTRAS[extra]) - set(missing_packages(extra))
    assert installed
    for package in installed:
        distribution = DISTRIBUTIONS.get(package, package)
        assert plain(distribution) in map(plain, holders()[package.partition(".")[0]])


ASKED: dict[str, tuple[str, str, Callable[[], object]]] = {
    "arms": ("arms", "robot_descriptions", lambda: find_urdf("ur5e")),
    "distributed": ("distributed", "distributed", lambda: aw.Workers(2)),
    "gp": ("gp", "torch", lambda: aw.optimize(aw.Problem(aw.load_task("target-1")), sampler="gp")),
    "editor": ("edit", "uvicorn", lambda: serve_editor(EditedFiles(Path("task.yaml")), print)),
    "model": ("llm", "pydantic_ai", lambda: aw.LlmProposer("openai-chat:gpt-4o")),
    "model of a study": ("llm", "openai", lambda: aw.StudyLlmProposer("openai-chat:gpt-4o", "two numbers")),
    "draft": ("llm", "openai", lambda: aw.draft("reach a shelf", "openai-chat:gpt-4o")),
}


@pytest.mark.parametrize("asked", ASKED)
def test_missing_package_names_its_install_command(asked: str, monkeypatch: pytest.MonkeyPatch) -> None:
    extra, package, ask = ASKED[asked]
    monkeypatch.setitem(sys.modules, package, None)
    for module in ("client", "connections", "errors", "responses", "transport"):
        monkeypatch.delitem(sys.modules, f"armwright.llm.{module}", raising=False)
    if extra in ("gp", "arms"):  # of which there may be more missing here, or less
        monkeypatch.setattr(extras, "missing_packages", lambda _: [package])
    with pytest.raises(MissingExtraError) as fault:
        ask()
    words = str(fault.value)
    assert words.endswith(f'needs {package}: pip install "armwright[{extra}]"')
    assert "\n" not in words
    assert isinstance(fault.value, UsageError)
    assert fault.value.exit_code == 2


def test_incompatible_version_is_reported() -> None:
    with pytest.raises(MissingExtraError) as fault, naming_extras("the page", "edit"):
        from json import no_such_name  # type: ignore[attr-defined] # noqa: F401
    words = str(fault.value)
    assert words.startswith("the page needs another version of json (cannot import name 'no_such_name'")
    assert words.endswith(': pip install "armwright[edit]"')
    assert "\n" not in words


def test_failed_import_of_an_extras_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError) as fault, naming_extras("datasheet"):
        import matplotlib  # noqa: F401
    assert str(fault.value) == 'datasheet needs matplotlib: pip install "armwright[figures]"'
    with pytest.raises(ModuleNotFoundError, match="no_such_module"), naming_extras("it"):
        import no_such_module  # noqa: F401  # pyright: ignore[reportMissingImports]


ASSEMBLY = [str(ROOT / "examples" / "2-assembly-task.yaml"), "--space", str(ROOT / "examples/2-assembly-space.yaml")]
NO_FIGURES = 'no figures without matplotlib: pip install "armwright[figures]"'
STUDIES = 'cloudpickle, jinja2, optuna and threadpoolctl: pip install "armwright[studies]"'
LLM = 'a language model needs anthropic, google.genai, openai and pydantic_ai: pip install "armwright[llm]"'

WITHOUT_EXTRAS: tuple[tuple[list[str], str], ...] = (  # what each command prints
    (["check", *ASSEMBLY], NO_FIGURES),
    (["design", *ASSEMBLY, "--evaluations", "1000", "--out", "run"], NO_FIGURES),
    (["pick", "run"], "assumed values halved or doubled, at worst"),
    (["export", "run"], "</robot>"),
    (["simulate", "run"], "pass in MuJoCo"),
    (["report", "run"], "run/report.html"),
    (["reach-map", "run", "--spacing", "0.4", "--directions", "1"], NO_FIGURES),
    (["compare", "run"], "front search"),
    (["doctor"], f"extra studies: {STUDIES.replace(' and ', ', ').replace(':', ' not installed:')}"),
)
WITH_EXTRAS: tuple[tuple[list[str], str], ...] = (  # their only line
    (["optimize", "target-1"], f"optimize needs {STUDIES}"),
    (["optimize", "target-1", "--proposer", "llm"], LLM),
    (["optimize", "target-1", "--model", "openai-chat:gpt-4o"], LLM),
    (["draft", "reach a shelf", "--model", "openai-chat:gpt-4o"], LLM),
    (["experiment", "paper"], f"experiment needs {STUDIES}"),
    (["optimize", "target-1", "--print-prompt"], f"optimize needs {STUDIES}"),
    (["datasheet", "run"], 'datasheet needs matplotlib: pip install "armwright[figures]"'),
)


@pytest.mark.slow
def test_base_install_needs_no_extra_and_names_those_that_are_missing(in_folder: Path) -> None:
    asked = (*WITHOUT_EXTRAS, *WITH_EXTRAS)
    command = [sys.executable, "-m", "tests.support.base_install", json.dumps([arguments for arguments, _ in asked])]
    done = subprocess.run(
        command, capture_output=True, check=True, encoding="utf-8", env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    ended = json.loads(done.stdout)
    for (arguments, expected), (code, output, errors) in zip(asked, ended, strict=True):
        if (arguments, expected) in WITHOUT_EXTRAS:
            assert code == 0, errors
            assert expected in " ".join((output + errors).split()), arguments
        else:
            assert (code, errors.strip()) == (2, f"armwright: {expected}"), arguments

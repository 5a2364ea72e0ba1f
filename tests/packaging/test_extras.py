"""Missing extras are reported in one line with the install command."""

import re
import sys
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest

import armwright as aw
from armwright import extras
from armwright.exceptions import MissingExtraError, UsageError
from armwright.extras import EXTRAS, missing_packages, requires_extra
from armwright.page.live_server import serve, start_server
from armwright.proof.simulation import mujoco_version
from armwright.robot.robot_descriptions import find_urdf
from tests import ROOT
from tests.support.extras import NEEDS_GP

STATED: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]


def plain(name: str) -> str:
    """A requirement's distribution, as PyPI writes it."""
    return re.sub("[-_.]+", "-", re.split(r"[\[<>=!~ ]", name)[0]).lower()


def test_extras_match_pyproject() -> None:
    stated = {extra: requirements for extra, requirements in STATED.items() if extra != "all"}
    assert set(EXTRAS) == set(stated)
    assert STATED["all"] == [f"armwright[{','.join(sorted(stated))}]"]
    assert re.match(r"pydantic-ai-slim\[anthropic,google,openai\]", *stated["llm"])  # which brings their packages
    assert [*EXTRAS["llm"].values()] == ["anthropic", "google-genai", "openai", "pydantic-ai-slim"]
    for extra in set(EXTRAS) - {"llm"}:
        assert {plain(name) for name in EXTRAS[extra].values()} == {plain(name) for name in stated[extra]}


@cache
def holders() -> Mapping[str, list[str]]:
    """The distributions that hold each package installed here."""
    return metadata.packages_distributions()


@pytest.mark.parametrize("extra", [pytest.param(one, marks=NEEDS_GP if one == "gp" else ()) for one in EXTRAS])
def test_packages_of_an_extra_belong_to_its_distributions(extra: str) -> None:
    installed = EXTRAS[extra].keys() - missing_packages(extra)
    assert installed
    for package in installed:
        distribution = EXTRAS[extra][package]
        assert plain(distribution) in map(plain, holders()[package.partition(".")[0]])


ASKED: dict[str, tuple[str, str, Callable[[], object]]] = {
    "arms": ("arms", "robot_descriptions", lambda: find_urdf("ur5e")),
    "distributed": ("distributed", "distributed", lambda: aw.Workers(2)),
    "gp": ("gp", "torch", lambda: aw.optimize(aw.Problem(aw.load_task("target-1")), sampler="gp")),
    "simulation": ("sim", "mujoco", mujoco_version),
    "page": ("live", "uvicorn", lambda: serve(Path("run"), print)),
    "page of a run": ("live", "starlette", lambda: start_server(Path("run"))),
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
    with pytest.raises(MissingExtraError) as fault, requires_extra("live", "the page"):
        from json import no_such_name  # type: ignore[attr-defined] # noqa: F401
    words = str(fault.value)
    assert words.startswith("the page needs another version of json (cannot import name 'no_such_name'")
    assert words.endswith(': pip install "armwright[live]"')
    assert "\n" not in words

"""The OptunaHub package, loaded by OptunaHub, and the requirements of its registry."""

import re
import subprocess
import sys
from types import ModuleType
from typing import Any

import optuna
import optunahub
import pytest
import yaml

import armwright as aw
from tests import ROOT
from tests.proposers.for_optuna.conftest import _quiet as _quiet

REGISTRY = ROOT / "optunahub" / "package"
NAME = "callbacks/armwright_proposals"
FOLDER = REGISTRY / NAME
README = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def module() -> ModuleType:
    return optunahub.load_local_module(NAME, registry_root=str(REGISTRY))


def test_optunahub_loads_the_package(module: ModuleType) -> None:
    """What it offers is armwright's own, so that there is one code."""
    assert {name: getattr(module, name) for name in module.__all__} == {n: getattr(aw, n) for n in module.__all__}
    study = optuna.create_study()
    callback = module.ProposalCallback(module.StudyRulesProposer(), every=5)
    study.optimize(lambda trial: trial.suggest_float("x", -9, 9) ** 2, n_trials=10, callbacks=[callback])
    assert [trial.number for trial in study.trials if "proposal" in trial.user_attrs] == [4, 9]


def test_package_meets_the_registry_requirements() -> None:
    """The keys that its header_confirm.py looks for, all in strings; the files and sections of its template."""
    _, header, text = README.split("---\n", 2)
    noted: dict[str, Any] = yaml.safe_load(header)
    assert set(noted) == {"author", "title", "description", "tags", "optuna_versions", "license"}
    assert all(noted.values())
    assert "callback" in noted["tags"]
    assert all(isinstance(word, str) for word in [*noted["tags"], *noted["optuna_versions"]])
    assert noted["optuna_versions"] == [optuna.__version__]
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == ["Abstract", "APIs", "Installation", "Example"]
    assert not re.search(r"<[a-z/]", text)  # no HTML
    assert {path.name for path in FOLDER.iterdir()} - {"__pycache__"} == {
        *("README.md", "__init__.py", "LICENSE", "example.py", "requirements.txt")
    }
    assert "MIT License" in (FOLDER / "LICENSE").read_text(encoding="utf-8")
    assert (FOLDER / "requirements.txt").read_text(encoding="utf-8") == "armwright[llm]\n"


def test_readme_names_the_public_api(module: ModuleType) -> None:
    for name in module.__all__:
        assert f"`{name}" in README
    (callback,) = re.findall(r"`ProposalCallback\((.*)\)`", README)
    given = re.findall(r"(\w+)(?==|,|$)", re.sub(r"=[^,]+", "", callback))
    assert set(given) < {*aw.ProposalCallback.__init__.__code__.co_varnames}


def test_readme_example_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)

    def from_here(package: str) -> ModuleType:
        return optunahub.load_local_module(package, registry_root=str(REGISTRY))

    monkeypatch.setattr(optunahub, "load_module", from_here)
    exec(code, {})
    assert capsys.readouterr().out.startswith("4 [")


@pytest.mark.slow
def test_example_script_runs() -> None:
    command = [sys.executable, "-W", "error", FOLDER / "example.py", "--n-trials", "30"]
    said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, encoding="utf-8").stdout
    assert said.startswith("6 proposals by rules, faults: none\n")


def test_missing_armwright_names_its_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "armwright", None)
    with pytest.raises(ModuleNotFoundError, match=r'armwright is missing: pip install "armwright\[llm\]"'):
        optunahub.load_local_module(NAME, registry_root=str(REGISTRY))

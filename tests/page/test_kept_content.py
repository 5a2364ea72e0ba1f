"""report.html is made once, stays while it is true, and is made again if anything changed."""

import json
import shutil
import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from armwright.page import page
from armwright.page.content import RunContent
from armwright.page.page import write_report
from tests import ROOT
from tests.fuzz.run_targets import EXISTING

CEILING = 35  # modules
_opened: list[Path] | None = None


def _note_file(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _opened is not None and isinstance(arguments[0], str):
        _opened.append(Path(arguments[0]).resolve())


sys.addaudithook(_note_file)


def opened_by_report(folder: Path) -> set[Path]:
    """Return the files of a run folder that writing its page opens, without those that it writes."""
    global _opened
    _opened = []
    write_report(folder)
    found, _opened = set(_opened), None
    return {path for path in found if path.is_relative_to(folder) and path.suffix != ".part"}


@pytest.fixture
def run(studied: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(studied, tmp_path / studied.name))


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders whose content is computed."""
    found: list[Path] = []

    def content(folder: Path) -> RunContent:
        found.append(folder)
        return RunContent(folder)

    monkeypatch.setattr(page, "RunContent", content)
    return found


def test_page_of_a_finished_run_calls_few_modules(run: Path) -> None:
    spec = spec_from_file_location("call_path", ROOT / "tools" / "call_path.py")
    assert spec is not None
    assert spec.loader is not None
    tool = module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert 0 < len(tool.modules_called(run)) <= CEILING


def test_page_of_an_unchanged_run_stays(run: Path, computed: list[Path]) -> None:
    before = (run / "report.html").read_bytes()
    moved = Path(shutil.move(run, run.parent / "elsewhere" / run.name))  # its name is on the page
    for file in moved.rglob("*"):
        file.touch()
    (moved / "figures").mkdir(exist_ok=True)  # as they are drawn after the page
    (moved / "figures" / "front.png").write_bytes(b"")
    assert write_report(moved) == moved / "report.html"
    assert ((moved / "report.html").read_bytes(), computed) == (before, [])


def edited(name: str, change: Callable[[str], str]) -> Callable[[Path], None]:
    """Return an edit of the first file of a run that this pattern finds."""

    def edit(run: Path) -> None:
        path = min(run.glob(name))
        text = path.read_text(encoding="utf-8")
        assert change(text) != text
        path.write_text(change(text), encoding="utf-8")

    return edit


def written(name: str, text: str) -> Callable[[Path], None]:
    return lambda run: (run / name).write_text(text, encoding="utf-8") and None


def without_last_trial(text: str) -> str:
    return "".join(text.splitlines(keepends=True)[:-1])


CHANGES: dict[str, Callable[[Path], None]] = {
    "settings": edited("config.yaml", lambda text: text.replace("seed: 1", "seed: 2")),
    "fewer trials": edited("trials.jsonl", without_last_trial),
    "another result": edited("summary.json", lambda text: text.replace('"final": ', '"final": 1')),
    "damaged results": edited("summary.json", lambda text: text[:-20]),
    "results gone": lambda run: (run / "summary.json").unlink(),
    "record": edited("designs/*/design.json", lambda text: text.replace('"label": "', '"label": "x', 1)),
    "damaged record": edited("designs/*/design.json", lambda text: text[:200]),
    "model of a design": edited("designs/*/arm.xml", lambda text: text + "<!-- mine -->"),
    "file of a design": edited("designs/*/arm.urdf", lambda text: text + "<!-- mine -->"),
    "designs gone": lambda run: shutil.rmtree(run / "designs"),
    "command": written("command.txt", "armwright optimize"),
    "existing arm": written("existing_arms.json", json.dumps([EXISTING])),
    "page gone": lambda run: (run / "report.html").unlink(),
    "page cut": edited("report.html", lambda text: text[: text.index('id="content">') + 500]),
    "page edited": edited("report.html", lambda text: text.replace("<body", "<body hidden", 1)),
    "content damaged": edited("report.html", lambda text: text.replace('id="content">eJ', 'id="content">eK')),
    "sum damaged": edited("report.html", lambda text: text.replace("made from ", "made from 0")),
}


@pytest.mark.parametrize("change", CHANGES)
def test_page_is_made_again_after_a_change(change: str, run: Path, computed: list[Path]) -> None:
    CHANGES[change](run)
    found = write_report(run).read_bytes()
    assert computed == [run]
    (run / "report.html").unlink()
    assert write_report(run).read_bytes() == found


def test_page_of_a_stranger_that_states_its_sum_does_not_stay(run: Path, computed: list[Path]) -> None:
    ours = (run / "report.html").read_bytes()
    for mine, other in ((b"<body", b"<body onload='steal()'"), (b"<script>", b"<script>steal();"), (b"'none'", b"*")):
        forged = ours.rpartition(page.MARK)[0].replace(mine, other)
        sum_ = page._sum(page._origin(run), forged)  # pyright: ignore[reportPrivateUsage]
        (run / "report.html").write_bytes(forged + page.MARK + sum_)
        assert write_report(run).read_bytes() == ours
    assert computed == [run] * 3


def test_page_is_made_again_for_a_renamed_folder(run: Path, computed: list[Path]) -> None:
    renamed = run.rename(run.with_name("renamed"))
    assert "<title>renamed: armwright" in write_report(renamed).read_text(encoding="utf-8")
    assert computed == [renamed]


def test_page_is_made_again_by_another_version(
    run: Path, computed: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for version in "12":
        (tmp_path / "package").mkdir(exist_ok=True)
        (tmp_path / "package" / "facts.py").write_text(f"version = {version}\n", encoding="utf-8")
        monkeypatch.setattr(page, "PACKAGE", tmp_path / "package")
        for _ in range(2):
            write_report(run)
    assert computed == [run, run]


def test_page_stays_only_if_every_file_that_it_is_made_from_is_unchanged(run: Path) -> None:
    for change in ("command", "existing arm"):
        CHANGES[change](run)
    (run / "transcripts.jsonl").write_bytes(b"")
    read = opened_by_report(run)
    assert {"config.yaml", "trials.jsonl", "transcripts.jsonl", "design.json", "arm.xml"} <= {
        path.name for path in read
    }
    assert read <= opened_by_report(run)

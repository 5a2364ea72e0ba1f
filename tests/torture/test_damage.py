"""Truncated and overwritten run files: the run resumes, or one line names the file."""

import random
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ArmwrightError
from armwright.problem.problem import Problem
from armwright.runs.folder import read_config, read_run
from armwright.study.front.front_run import find_front
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import ChatServer
from tests.support.wire_formats import llm_proposer
from tests.torture.short import trials
from tests.torture.test_kills import thoughtful

PROBLEM = Problem(load_task("target-1"))
SETTINGS: dict[str, Any] = {"n_init": 4, "n_step": 3, "n_total": 8, "seed": 2, "verify": False}
Tell = Callable[[str, object], None]


def short(folder: Path, **settings: Any) -> StudyResult:
    return optimize(PROBLEM, **{"proposer": "rules", **SETTINGS, **settings}, out=folder)


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("intact") / "run"
    short(folder)
    return folder


@pytest.fixture
def folder(intact: Path, tmp_path: Path) -> Path:
    """A copy of the intact run."""
    return Path(shutil.copytree(intact, tmp_path / "run"))


def cut(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randrange(len(content))]


def spoilt(content: bytes, chance: random.Random) -> bytes:
    """With some bytes in the place of others."""
    at, n = chance.randrange(len(content)), chance.choice((1, 1, 8, 512))
    return content[:at] + chance.choice((bytes(n), chance.randbytes(n))) + content[at + n :]


def doubled(content: bytes, chance: random.Random) -> bytes:
    """With a part of it twice."""
    one, other = sorted(chance.randrange(len(content)) for _ in range(2))
    return content[:other] + content[one:]


Damage = Callable[[bytes, random.Random], bytes]
DAMAGE: tuple[Damage, ...] = (cut, spoilt, doubled)
# Whether a run cannot be resumed without them.
FILES = {
    "trials.jsonl": True, "config.yaml": True, "summary.json": False,
    "trials.csv": False, "front.csv": False, ".lock": False,
}  # fmt: skip


def resumes(folder: Path, name: str, go_on: Callable[[Path], object]) -> bool:
    """Whether a run goes on; else one line names the file or the setting that differs."""
    try:
        go_on(folder)
    except ArmwrightError as refusal:
        message = str(refusal)
        assert "\n" not in message
        assert name in message or "other settings" in message, message
        return False
    return True


def damage_often(intact: Path, name: str, n: int, tell: Tell, look: Callable[[Path, Damage], bool]) -> Counter[bool]:
    """Look at copies of a run with one file cut short, overwritten or doubled in part, at random places."""
    chance = random.Random(name)
    outcomes: Counter[bool] = Counter()
    for number in range(n):
        folder = intact.with_name(f"damaged{number}")
        shutil.copytree(intact, folder)
        damage = DAMAGE[number % len(DAMAGE)]
        (folder / name).write_bytes(damage((intact / name).read_bytes() or b" ", chance))
        outcomes[look(folder, damage)] += 1
        shutil.rmtree(folder)
    tell(f"damaged {name}", f"{n} times: {outcomes[True]} resumed, {outcomes[False]} refused")
    return outcomes


@pytest.mark.parametrize("name", FILES)
def test_damaged_file_is_reported_or_harmless(name: str, intact: Path, kills: int, record_property: Tell) -> None:
    """Trials whose numbers changed to other valid ones are not noticed: there are no checksums."""

    def look(folder: Path, damage: Damage) -> bool:
        before = (folder / "trials.jsonl").read_bytes()
        if not resumes(folder, name, short):
            assert (folder / "trials.jsonl").read_bytes() == before
            return False
        if name != "trials.jsonl" or damage is cut:
            assert trials(folder) == trials(intact)
        else:
            assert [trial["number"] for trial in trials(folder)] == list(range(len(trials(intact))))
        return True

    outcomes = damage_often(intact, name, kills, record_property, look)
    assert bool(outcomes[False]) == FILES[name]


@pytest.mark.parametrize("name", FILES)
def test_folder_in_place_of_a_file_is_reported(folder: Path, intact: Path, name: str) -> None:
    (folder / name).unlink()
    (folder / name).mkdir()
    if not resumes(folder, name, short):
        (folder / name).rmdir()
        shutil.copy(intact / name, folder / name)
    assert trials(folder) == trials(intact)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: [*lines[:6], b"", *lines[6:]], "line 7 is damaged (blank)"),
        (lambda lines: [lines[0].replace(b"{", b'{"wheels": 4, ', 1), *lines[1:]], "line 1 is damaged"),  # newer
    ],
    ids=["blank", "unknown key"],
)
def test_wrong_line_of_trials_is_named(folder: Path, change: Callable[[list[bytes]], list[bytes]], words: str) -> None:
    """Others: tests/runs/test_run_folder.py."""
    lines = change((folder / "trials.jsonl").read_bytes().splitlines())
    (folder / "trials.jsonl").write_bytes(b"".join(line + b"\n" for line in lines))
    for read in (short, read_run):
        with pytest.raises(ArmwrightError) as refusal:
            read(folder)
        assert words in str(refusal.value)


def test_damaged_transcripts_are_reported_or_harmless(
    tmp_path: Path, chat_server: ChatServer, kills: int, record_property: Tell
) -> None:
    chat_server.answer = thoughtful

    def ask(folder: Path) -> StudyResult:
        return short(folder, proposer=llm_proposer(chat_server.url, model="m"))

    intact = tmp_path / "intact"
    ask(intact)
    lines = (intact / "trials.jsonl").read_bytes().splitlines(keepends=True)

    def look(folder: Path, damage: Damage) -> bool:
        """Half of the trials are still to come; what was answered is in the transcript, as far as it is intact."""
        (folder / "trials.jsonl").write_bytes(b"".join(lines[:5]))
        resumed = resumes(folder, "transcripts.jsonl", ask)
        if damage is cut:
            assert resumed
            assert trials(folder) == trials(intact)
        assert [trial["number"] for trial in trials(folder)] == list(range(len(lines) if resumed else 5))
        return resumed

    damage_often(intact, "transcripts.jsonl", kills, record_property, look)


def test_damaged_search_state_is_reported_or_harmless(tmp_path: Path, kills: int, record_property: Tell) -> None:
    def search(folder: Path, evaluations: int = 3000) -> object:
        return find_front(PROBLEM, evaluations=evaluations, seed=1, stop_at_stall=False, out=folder)

    intact, extended, restarted = (tmp_path / name for name in ("intact", "extended", "restarted"))
    search(intact, 2000)
    for undamaged in (extended, restarted):
        shutil.copytree(intact, undamaged)
    (restarted / "search.npz").unlink()
    search(extended)
    search(restarted)

    def look(folder: Path, _: Damage) -> bool:
        resumed = resumes(folder, "search.npz", search)
        if not resumed:
            (folder / "search.npz").unlink()  # as the message says
            search(folder)
        assert trials(folder) == trials(extended if resumed else restarted)
        return resumed

    assert damage_often(intact, "search.npz", max(3, kills // 10), record_property, look)[False]


def test_run_of_a_newer_version_is_refused(folder: Path, intact: Path) -> None:
    ours = read_config(intact).versions["armwright"]
    text = (folder / "config.yaml").read_text(encoding="utf-8").replace(f"armwright: {ours}", "armwright: 99.1.0")
    (folder / "config.yaml").write_text(f"wheels: 4\n{text}", encoding="utf-8")
    with pytest.raises(ArmwrightError, match=rf'"wheels".*\(written by armwright 99\.1\.0; this is {ours}\)'):
        short(folder)

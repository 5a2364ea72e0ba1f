"""Files of a run cut short, and with others' bytes: the run goes on as it was, or one line names the file."""

import json
import random
import shutil
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ArmwrightError, RunConflictError
from armwright.front import find_front
from armwright.problem import Problem
from armwright.proposers.llm import LlmProposer
from armwright.report.page import write_report
from armwright.run_folder import read_config, versions
from armwright.study import Run, optimize
from armwright.task import load_task
from tests.chat_server import ChatServer
from tests.torture.lives import trials
from tests.torture.test_kills import thoughtful

PROBLEM = Problem(load_task("target-1"))
SETTINGS: dict[str, Any] = {"n_init": 4, "n_step": 3, "n_total": 8, "seed": 2, "verify": False}
OLDER = Path(__file__).parent / "older"
Tell = Callable[[str, object], None]


def short(folder: Path, **settings: Any) -> Run:
    return optimize(PROBLEM, **{"proposer": "rules", **SETTINGS, **settings}, out=folder)


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("intact") / "run"
    short(folder)
    (folder / "control.json").write_text('{"paused": false, "stop": false, "hints": [{"id": 1, "text": "a hint"}]}')
    return folder


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


DAMAGE = (cut, spoilt, doubled)
FILES = (
    "trials.jsonl",
    "config.yaml",
    "status.json",
    "control.json",
    "summary.json",
    "trials.csv",
    "front.csv",
    "study.db",
    ".lock",
)


def goes_on(folder: Path, name: str, go_on: Callable[[Path], object]) -> str:
    """`resumed`, or `refused` in one line that names the file or what in it cannot be."""
    try:
        go_on(folder)
    except ArmwrightError as refusal:
        words = str(refusal)
        assert "\n" not in words
        assert name in words or "other settings" in words, words
        return "refused"
    return "resumed"


@pytest.mark.parametrize("name", FILES)
def test_damaged_files(tmp_path: Path, intact: Path, name: str, kills: int, record_property: Tell) -> None:
    chance = random.Random(name)
    came_to: Counter[str] = Counter()
    for n in range(kills):
        folder = tmp_path / f"run{n}"
        shutil.copytree(intact, folder)
        before = (intact / name).read_bytes() or b" "
        damage = DAMAGE[n % len(DAMAGE)]
        (folder / name).write_bytes(damage(before, chance))
        came_to[goes_on(folder, name, short)] += 1
        if (damage is cut or name not in ("trials.jsonl", "config.yaml")) and came_to["resumed"] and folder.exists():
            there = trials(folder)
            assert there == trials(intact)[: len(there)]
        shutil.rmtree(folder)
    record_property(f"damaged {name}", f"{kills} times: {came_to['resumed']} resumed, {came_to['refused']} refused")


def test_trials_cut_at_any_byte_are_made_again(tmp_path: Path, intact: Path, kills: int) -> None:
    content = (intact / "trials.jsonl").read_bytes()
    chance = random.Random("cut")
    for n in range(kills):
        folder = tmp_path / f"run{n}"
        shutil.copytree(intact, folder)
        (folder / "trials.jsonl").write_bytes(content[: chance.randrange(1, len(content))])
        if b"\n" not in (folder / "trials.jsonl").read_bytes():
            with pytest.raises(RunConflictError, match=r"no trial in trials.jsonl"):
                short(folder)
            continue
        short(folder)
        assert trials(folder) == trials(intact)


def test_a_config_cut_at_any_line_is_refused_or_the_same_run(tmp_path: Path, intact: Path) -> None:
    lines = (intact / "config.yaml").read_text().splitlines(keepends=True)
    for n in range(len(lines)):
        folder = tmp_path / f"run{n}"
        shutil.copytree(intact, folder)
        (folder / "config.yaml").write_text("".join(lines[:n]))
        if goes_on(folder, "config.yaml", short) == "resumed":
            assert n > len(lines) - 12, lines[n]  # versions that are not told
            assert trials(folder) == trials(intact)


@pytest.mark.parametrize(
    "name", ["trials.jsonl", "config.yaml", "status.json", "control.json", "summary.json", ".lock"]
)
def test_a_folder_where_a_file_should_be(tmp_path: Path, intact: Path, name: str) -> None:
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    (folder / name).unlink()
    (folder / name).mkdir()
    if name in ("trials.jsonl", "config.yaml", ".lock"):
        with pytest.raises(ArmwrightError, match=name):
            short(folder)
    else:
        with suppress(ArmwrightError):  # a name that is taken is said
            short(folder)
        assert trials(folder) == trials(intact)


def test_damaged_transcripts(tmp_path: Path, chat_server: ChatServer, kills: int, record_property: Tell) -> None:
    chat_server.answer = thoughtful

    def ask(folder: Path) -> Run:
        return short(folder, proposer=LlmProposer("m", chat_server.url))

    intact, chance = tmp_path / "intact", random.Random("transcripts")
    ask(intact)
    content = (intact / "transcripts.jsonl").read_bytes()
    came_to: Counter[str] = Counter()
    for n in range(kills):
        folder = tmp_path / f"run{n}"
        shutil.copytree(intact, folder)
        # Half of the trials are still to come; what was answered is in the transcript, as far as it is intact.
        lines = (intact / "trials.jsonl").read_bytes().splitlines(keepends=True)
        (folder / "trials.jsonl").write_bytes(b"".join(lines[:5]))
        damage = DAMAGE[n % len(DAMAGE)]
        (folder / "transcripts.jsonl").write_bytes(damage(content, chance))
        came_to[goes_on(folder, "transcripts.jsonl", ask)] += 1
        if damage is cut:
            assert trials(folder) == trials(intact)
    record_property(
        "damaged transcripts.jsonl", f"{kills} times: {came_to['resumed']} resumed, {came_to['refused']} refused"
    )


def test_a_damaged_search(tmp_path: Path, kills: int, record_property: Tell) -> None:
    def search(folder: Path, budget: str = "3000") -> object:
        return find_front(PROBLEM, budget=budget, seed=1, stop_at_stall=False, out=folder)

    intact, chance = tmp_path / "intact", random.Random("search")
    search(intact, "2000")
    content = (intact / "search.npz").read_bytes()
    came_to: Counter[str] = Counter()
    for n in range(max(3, kills // 10)):
        folder = tmp_path / f"run{n}"
        shutil.copytree(intact, folder)
        (folder / "search.npz").write_bytes(DAMAGE[n % 2](content, chance))
        if goes_on(folder, "search.npz", search) == "refused":
            came_to["refused"] += 1
            (folder / "search.npz").unlink()  # as the words say
            search(folder)
        else:
            came_to["resumed"] += 1
    record_property(
        "damaged search.npz", f"{came_to.total()} times: {came_to['resumed']} resumed, {came_to['refused']} refused"
    )


def test_a_run_of_an_older_version_goes_on(tmp_path: Path) -> None:
    """Made before payloads, constraints and obstacles were in config.yaml; read, extended and shown."""
    folder = tmp_path / "run"
    shutil.copytree(OLDER, folder)
    before = (OLDER / "trials.jsonl").read_bytes()
    run = optimize(PROBLEM, proposer="rules", n_init=4, n_step=3, n_total=9, seed=0, out=folder)
    assert (run.resumed, len(run.trials)) == (10, 13)
    assert (folder / "trials.jsonl").read_bytes().startswith(before)
    assert run.config.versions == versions()
    assert write_report(folder).is_file()


def test_a_run_of_a_newer_version_is_refused_by_name(tmp_path: Path, intact: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    ours = read_config(intact).versions["armwright"]
    text = (folder / "config.yaml").read_text().replace(f"armwright: {ours}", "armwright: 99.1.0")
    (folder / "config.yaml").write_text(f"wheels: 4\n{text}")
    with pytest.raises(ArmwrightError, match=rf'"wheels".*\(written by armwright 99\.1\.0; this is {ours}\)'):
        short(folder)


def test_a_trial_of_a_newer_version_is_refused_by_line(tmp_path: Path, intact: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    first, *others = (folder / "trials.jsonl").read_text().splitlines(keepends=True)
    (folder / "trials.jsonl").write_text(json.dumps({**json.loads(first), "wheels": 4}) + "\n" + "".join(others))
    with pytest.raises(ArmwrightError, match="line 1 is damaged"):
        short(folder)

"""Truncated and overwritten run files: the run resumes, or one line names the file."""

import json
import random
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ArmwrightError, RunConflictError
from armwright.page.page import write_report
from armwright.pictures.figures import write_figures
from armwright.problem.problem import Problem
from armwright.proof.selection import pick_from
from armwright.runs.config import versions
from armwright.runs.folder import read_config, read_run
from armwright.study.front.front_run import find_front
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import ChatServer
from tests.support.wire_formats import llm_proposer
from tests.torture.lives import trials
from tests.torture.test_kills import thoughtful

PROBLEM = Problem(load_task("target-1"))
SETTINGS: dict[str, Any] = {"n_init": 4, "n_step": 3, "n_total": 8, "seed": 2, "verify": False}
OLDER = Path(__file__).parent / "older"
Tell = Callable[[str, object], None]


def short(folder: Path, **settings: Any) -> StudyResult:
    return optimize(PROBLEM, **{"proposer": "rules", **SETTINGS, **settings}, out=folder)


@pytest.fixture(scope="module")
def intact(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("intact") / "run"
    short(folder)
    (folder / "control.json").write_text(
        '{"paused": false, "stop": false, "hints": [{"id": 1, "text": "a hint"}]}', encoding="utf-8"
    )
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


Damage = Callable[[bytes, random.Random], bytes]
DAMAGE: tuple[Damage, ...] = (cut, spoilt, doubled)
NEEDED = ("trials.jsonl", "config.yaml")  # a run cannot be resumed without them
DERIVED = (
    "status.json",
    "control.json",
    "summary.json",
    "trials.csv",
    "front.csv",
    ".lock",
)


def resume(folder: Path, name: str, go_on: Callable[[Path], object]) -> str:
    """`resumed`, or `refused` in one line that names the file or the setting that differs."""
    try:
        go_on(folder)
    except ArmwrightError as refusal:
        message = str(refusal)
        assert "\n" not in message
        assert name in message or "other settings" in message, message
        return "refused"
    return "resumed"


def damaged_copies(intact: Path, tmp_path: Path, name: str, n: int) -> Iterator[tuple[Path, Damage]]:
    """Copies of a run with one file cut short, overwritten in part or doubled in part, at random places."""
    chance = random.Random(name)
    for number in range(n):
        folder = tmp_path / f"run{number}"
        shutil.copytree(intact, folder)
        damage = DAMAGE[number % len(DAMAGE)]
        (folder / name).write_bytes(damage((intact / name).read_bytes() or b" ", chance))
        yield folder, damage
        shutil.rmtree(folder)


def count(outcomes: Counter[str]) -> str:
    return f"{outcomes.total()} times: {outcomes['resumed']} resumed, {outcomes['refused']} refused"


@pytest.mark.parametrize("name", DERIVED)
def test_damaged_derived_file_does_not_change_a_resumed_run(
    tmp_path: Path, intact: Path, name: str, kills: int, record_property: Tell
) -> None:
    for folder, _ in damaged_copies(intact, tmp_path, name, kills):
        assert resume(folder, name, short) == "resumed"
        assert trials(folder) == trials(intact)
    record_property(f"damaged {name}", f"{kills} times: all resumed")


@pytest.mark.parametrize("name", NEEDED)
def test_damaged_required_file_is_reported_or_harmless(
    tmp_path: Path, intact: Path, name: str, kills: int, record_property: Tell
) -> None:
    """Trials whose numbers changed to other valid ones are not noticed: there are no checksums."""
    outcomes: Counter[str] = Counter()
    for folder, damage in damaged_copies(intact, tmp_path, name, kills):
        before = (folder / "trials.jsonl").read_bytes()
        outcome = resume(folder, name, short)
        outcomes[outcome] += 1
        if outcome == "refused":
            assert (folder / "trials.jsonl").read_bytes() == before
        elif name == "config.yaml" or damage is cut:
            assert trials(folder) == trials(intact)
        else:
            assert [trial["number"] for trial in trials(folder)] == list(range(len(trials(intact))))
    assert outcomes["refused"]
    record_property(f"damaged {name}", count(outcomes))


def test_trials_truncated_at_any_byte_are_repeated(tmp_path: Path, intact: Path, kills: int) -> None:
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


def with_number(content: bytes, key: str, value: object) -> bytes:
    """Return the trials with another value at the start of a field of the sixth."""
    lines = content.splitlines()
    trial = json.loads(lines[5])
    trial[key] = {"total": value} if key == "seconds" else [value, *trial.get(key, [0.0, 0.0])[1:]]
    lines[5] = json.dumps(trial).encode()
    return b"\n".join(lines) + b"\n"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: [*lines[:6], *lines[5:]], "line 7 is damaged (expected trial number 6, found 5)"),
        (lambda lines: [*lines[:4], lines[5], lines[4], *lines[6:]], "line 5 is damaged (expected trial number 4,"),
        (lambda lines: [*lines[:6], b"", *lines[6:]], "line 7 is damaged (blank)"),
        (lambda lines: [*lines, b""], "line 13 is damaged (blank)"),
        (lambda lines: [*lines, b" \t\r"], "line 13 is damaged (blank)"),
    ],
    ids=["twice", "out of order", "blank", "blank at the end", "spaces at the end"],
)
def test_misplaced_line_of_trials_is_named(
    tmp_path: Path, intact: Path, change: Callable[[list[bytes]], list[bytes]], words: str
) -> None:
    lines = (intact / "trials.jsonl").read_bytes().splitlines()
    shutil.copytree(intact, tmp_path / "run")
    (tmp_path / "run" / "trials.jsonl").write_bytes(b"".join(line + b"\n" for line in change(lines)))
    for read in (lambda: short(tmp_path / "run"), lambda: read_run(tmp_path / "run")):
        with pytest.raises(ArmwrightError) as refusal:
            read()
        assert words in str(refusal.value)
        assert "\n" not in str(refusal.value)


def test_trials_with_line_ends_of_windows_resume(tmp_path: Path, intact: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    content = (folder / "trials.jsonl").read_bytes()
    (folder / "trials.jsonl").write_bytes(content.replace(b"\n", b"\r\n"))
    short(folder, n_total=10)
    assert trials(folder)[: len(trials(intact))] == trials(intact)


def test_huge_number_of_a_trial_is_named(tmp_path: Path) -> None:
    task = load_task("target-1").model_copy(update={"constraints": ("length <= 9", "mass <= 9")})
    folder = tmp_path / "run"
    optimize(Problem(task), **SETTINGS, proposer="rules", out=folder)
    content = (folder / "trials.jsonl").read_bytes()
    for key in ("values", "violations", "seconds"):
        at = "seconds.total" if key == "seconds" else f"{key}.0"
        for value in (-1.7e308, -1e308, 1e101, 1.7976931348623157e308):
            (folder / "trials.jsonl").write_bytes(with_number(content, key, value))
            with pytest.raises(ArmwrightError) as refusal:
                read_run(folder)
            assert f"line 6 is damaged ({at}: expected a number within ±1e+" in str(refusal.value)
            assert "\n" not in str(refusal.value)


@pytest.mark.slow
@pytest.mark.parametrize("values", [(-1e60, 1e60), (1e60, 1e60), (5e-324, -5e-324), (-0.0, 1e-310)])
def test_numbers_at_the_limits_are_read_drawn_and_extended(
    tmp_path: Path, intact: Path, values: tuple[float, float]
) -> None:
    """Warnings are errors."""
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    lines = [json.dumps({**trial, "values": values}) + "\n" for trial in trials(folder)]
    (folder / "trials.jsonl").write_text("".join(lines), encoding="utf-8")
    for file in (write_report(folder), *write_figures(folder)):
        assert file.is_file()
    pick_from(folder)
    run = short(folder, n_total=12)
    json.dumps(run.summary, allow_nan=False, default=str)


def test_config_truncated_at_any_line_is_refused_or_harmless(tmp_path: Path, intact: Path) -> None:
    lines = (intact / "config.yaml").read_text(encoding="utf-8").splitlines(keepends=True)
    for n in range(len(lines)):
        folder = tmp_path / f"run{n}"
        shutil.copytree(intact, folder)
        (folder / "config.yaml").write_text("".join(lines[:n]), encoding="utf-8")
        if resume(folder, "config.yaml", short) == "resumed":
            assert n > len(lines) - 12, lines[n]  # versions that are not told
            assert trials(folder) == trials(intact)


@pytest.mark.parametrize(
    "name", ["trials.jsonl", "config.yaml", "status.json", "control.json", "summary.json", ".lock"]
)
def test_folder_in_place_of_a_file_is_reported(tmp_path: Path, intact: Path, name: str) -> None:
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


def test_damaged_transcripts_are_reported_or_harmless(
    tmp_path: Path, chat_server: ChatServer, kills: int, record_property: Tell
) -> None:
    chat_server.answer = thoughtful

    def ask(folder: Path) -> StudyResult:
        return short(folder, proposer=llm_proposer(chat_server.url, model="m"))

    intact = tmp_path / "intact"
    ask(intact)
    outcomes: Counter[str] = Counter()
    for folder, damage in damaged_copies(intact, tmp_path, "transcripts.jsonl", kills):
        # Half of the trials are still to come; what was answered is in the transcript, as far as it is intact.
        lines = (intact / "trials.jsonl").read_bytes().splitlines(keepends=True)
        (folder / "trials.jsonl").write_bytes(b"".join(lines[:5]))
        outcome = resume(folder, "transcripts.jsonl", ask)
        outcomes[outcome] += 1
        if damage is cut:
            assert outcome == "resumed"
            assert trials(folder) == trials(intact)
        kept = len(lines) if outcome == "resumed" else 5
        assert [trial["number"] for trial in trials(folder)] == list(range(kept))
    record_property("damaged transcripts.jsonl", count(outcomes))


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
    outcomes: Counter[str] = Counter()
    for folder, _ in damaged_copies(intact, tmp_path, "search.npz", max(3, kills // 10)):
        outcome = resume(folder, "search.npz", search)
        outcomes[outcome] += 1
        if outcome == "refused":
            (folder / "search.npz").unlink()  # as the message says
            search(folder)
        assert trials(folder) == trials(restarted if outcome == "refused" else extended)
    assert outcomes["refused"]
    record_property("damaged search.npz", count(outcomes))


def test_run_of_an_older_version_resumes(tmp_path: Path) -> None:
    """Made before payloads, constraints and obstacles were in config.yaml; read, extended and shown."""
    folder = tmp_path / "run"
    shutil.copytree(OLDER, folder)
    before = (OLDER / "trials.jsonl").read_bytes()
    run = optimize(PROBLEM, proposer="rules", n_init=4, n_step=3, n_total=9, seed=0, out=folder)
    assert (run.resumed, len(run.trials)) == (10, 13)
    assert (folder / "trials.jsonl").read_bytes().startswith(before)
    assert run.config.versions == versions()
    assert write_report(folder).is_file()


def test_run_of_a_newer_version_is_refused(tmp_path: Path, intact: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    ours = read_config(intact).versions["armwright"]
    text = (folder / "config.yaml").read_text(encoding="utf-8").replace(f"armwright: {ours}", "armwright: 99.1.0")
    (folder / "config.yaml").write_text(f"wheels: 4\n{text}", encoding="utf-8")
    with pytest.raises(ArmwrightError, match=rf'"wheels".*\(written by armwright 99\.1\.0; this is {ours}\)'):
        short(folder)


def test_trial_of_a_newer_version_is_refused(tmp_path: Path, intact: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(intact, folder)
    first, *others = (folder / "trials.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (folder / "trials.jsonl").write_text(
        json.dumps({**json.loads(first), "wheels": 4}) + "\n" + "".join(others), encoding="utf-8"
    )
    with pytest.raises(ArmwrightError, match="line 1 is damaged"):
        short(folder)

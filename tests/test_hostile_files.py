"""Hostile files and answers that once caused a failure are read or refused in one line.

`tests/fuzz` found most of them.
"""

import json
import shutil
from pathlib import Path

import pytest

from armwright.exceptions import RunFolderError, SettingsError, SpaceError, TaskError
from armwright.experiments.cells import plan_cells
from armwright.experiments.plan import load_experiment
from armwright.llm.transcript import Transcript
from armwright.proof.results import read_summary
from armwright.spaces.design_space import load_space
from armwright.tasks.catalogue import load_task
from armwright.yaml_documents import MAX_BYTES
from tests.fuzz.run_targets import a_run, looked_at


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: !!int ''", "tags"),  # PyYAML: IndexError
        ("name: !!bool maybe", "tags"),  # KeyError
        ("name: !!timestamp never", "tags"),  # AttributeError
        ("name: !!python/object/apply:os.system [id]", "tags"),
        (f"name: {'1:' * 400}1.0", "base 60"),  # OverflowError
        (f"name: {'1:' * 1_000_000}1", "base 60"),  # hours
        ("name: 0x" + "f" * 20_000, "expected text, got a huge number"),  # a number of too many digits to be shown
        ("name: " + "9" * 5000, "not valid YAML"),
        ('name: "\\ud800"', "not valid YAML"),
        ('"a\\nb": 1', "unknown key"),
        ('"\\e[2J": 1', "unknown key"),
        ("? " + "x" * 1_000_000 + "\n: 1", "unknown key"),
        ("a: &a [x]\nb: [*a, *a]", "aliases"),
        ("[" * 100_000, "nested too deeply"),
        ("a: " + "{a: " * 100_000, "nested too deeply"),
        pytest.param("a: [" + "1," * 400_000 + "1]", "400,000 values", marks=pytest.mark.slow),
        ("name: many\ntargets: [" + "[0,0,0]," * 10_001 + "]", "at most 10000"),
        ("name: x\ntargets: [[1e308, 0, 0]]", "more than 1000 m away"),
        ("name: x\ntargets: [[.nan, 0, 0]]", "finite number"),
        ("name: x\ntargets: [[" + "9" * 400 + ", 0, 0]]", "target"),
        ("name: ../../x\ntargets: [[0, 0, 0]]", "expected a name of at most 64 letters"),
        ('name: "a\\nb"\ntargets: [[0, 0, 0]]', "expected a name of at most 64 letters"),
        ("name: CON\ntargets: [[0, 0, 0]]", "Windows"),
        ("name: a.\ntargets: [[0, 0, 0]]", "Windows"),
    ],
    ids=lambda value: value[:30],
)
def test_hostile_documents_are_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "task.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(TaskError, match=words) as refusal:
        load_task(file)
    assert str(refusal.value).isprintable()
    assert len(str(refusal.value)) <= 3000


def test_endless_and_huge_files_are_refused(tmp_path: Path) -> None:
    for place in (Path("/dev/zero"), tmp_path / "big.yaml"):
        if place.parent == tmp_path:
            place.write_bytes(b" " * (MAX_BYTES + 1))
        with pytest.raises(SpaceError, match="at most 4,096 KiB"):
            load_space(place)
    with pytest.raises(SpaceError, match="cannot read"):
        load_space("a\0.yaml")


@pytest.mark.slow
def test_task_with_ten_thousand_targets_is_read(tmp_path: Path) -> None:
    record = "{position: [0.1, 0.2, 0.3], axis: [0, 0, -1], tolerance: 0.002, angle_tolerance: 0.05, weight: 2}"
    file = tmp_path / "task.yaml"
    file.write_text("name: many\ntargets:\n" + f"  - {record}\n" * 10_000, encoding="utf-8")
    assert len(load_task(file).targets) == 10_000


def test_experiment_with_too_many_cells_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text("name: x\ntasks: all\nseeds: 10000\nmethods: {a: {label: A}}\n", encoding="utf-8")
    with pytest.raises(SettingsError, match="310,000 cells"):
        plan_cells(*load_experiment(str(file)), tmp_path)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A finished run, to be damaged."""
    return Path(shutil.copytree(a_run(), tmp_path / "run"))


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("verification", "robust_numbers"), {}), (("hypervolume", "history"), [[1], 2]), (("seconds",), {}),
        (("attribution", "bbo"), None), (("proposer", "failures"), 1), (("front_size",), 10**400),
        (("front_gap",), {"share": 1}),
    ],
    ids=str,
)  # fmt: skip
@pytest.mark.fast_cases(3)
def test_damaged_summary_is_made_again(run: Path, place: tuple[str, ...], value: object) -> None:
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    within = summary
    for key in place[:-1]:
        within = within[key]
    within[place[-1]] = value
    (run / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    assert read_summary(run) is None
    looked_at(run)


@pytest.mark.parametrize("value", ["x", "llm-", "llm-x", "llm-9999999999", "-1\n"])
def test_transcript_with_an_invalid_proposal_is_refused(run: Path, value: str) -> None:
    calls = [json.loads(line) for line in (run / "transcripts.jsonl").read_text(encoding="utf-8").splitlines()]
    calls[1]["proposal"] = value
    (run / "transcripts.jsonl").write_text("".join(f"{json.dumps(call)}\n" for call in calls), encoding="utf-8")
    with pytest.raises(RunFolderError, match="line 2 is damaged"):
        Transcript(run / "transcripts.jsonl")


@pytest.mark.parametrize("url", ["http://a:x/v1", "http://[::1", "http://", "http://\x01/v1", "http://a b/v1"])
def test_invalid_server_address_is_refused(url: str) -> None:
    from armwright.llm.client import ModelClient
    from armwright.llm.model_options import ModelOptions

    with pytest.raises(SettingsError, match="expected an address such as"):
        ModelClient(ModelOptions(model="openai-chat:x", base_url=url))

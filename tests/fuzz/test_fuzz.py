"""Documents changed at random, in the short form of `make fuzz`; and each defect that it found, by itself."""

import json
import shutil
from contextlib import suppress
from pathlib import Path
from random import Random

import hypothesis
import pytest
from hypothesis import strategies

from armwright.documents import LARGEST_DOCUMENT
from armwright.exceptions import (
    ArmwrightError,
    RunFolderError,
    SettingsError,
    SpaceError,
    TaskError,
)
from armwright.experiment.plan import cells_of, load_experiment
from armwright.llm.prompt import load_prompt
from armwright.llm.transcript import Transcript
from armwright.report.page import write_report
from armwright.results import read_summary
from armwright.run_folder import read_config
from armwright.space import load_space
from armwright.task import Task, load_task
from armwright.task_template import task_template
from armwright.urdf.reading import read_urdf
from tests.fuzz.__main__ import INPUTS, TooSlowError, limited
from tests.fuzz.targets import TARGETS, DefectError, a_run, check, looked_at, seeds_of


def inputs(name: str) -> int:
    """As many as take half a second or so."""
    if name.startswith("run ") or name == "draft":
        return 4
    return 20 if TARGETS[name].heavy else 100


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_that_is_made_up_breaks_a_door(name: str) -> None:
    target = TARGETS[name]

    @hypothesis.settings(
        max_examples=inputs(name), derandomize=True, database=None, deadline=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )  # fmt: skip
    @hypothesis.given(strategies.randoms(use_true_random=False))
    def fuzz(rng: Random) -> None:
        with limited():
            check(target, target.make(rng))

    fuzz()


@pytest.mark.parametrize("name", TARGETS)
def test_what_is_changed_is_valid_before(name: str) -> None:
    """Else nothing would come far; some lines of arguments say what is wrong."""
    seeds = seeds_of(TARGETS[name])
    passed = [check(TARGETS[name], one) for one in seeds]
    assert sum(passed) >= 0.7 * len(seeds)


def test_every_target_has_its_part_of_a_whole_run() -> None:
    assert INPUTS.keys() == TARGETS.keys()
    assert 1.1 * sum(INPUTS.values()) > 1_000_000


def test_a_refusal_that_is_no_line_is_a_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("armwright.exceptions._line", str)
    with pytest.raises(DefectError, match="no line"):
        check(TARGETS["task"], b'"a\\nb": 1')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: !!int ''", "tags"),  # PyYAML: IndexError
        ("name: !!bool maybe", "tags"),  # KeyError
        ("name: !!timestamp never", "tags"),  # AttributeError
        ("name: !!python/object/apply:os.system [id]", "tags"),
        ("name: ! x", "tags"),
        (f"name: {'1:' * 400}1.0", "base 60"),  # OverflowError
        (f"name: {'1:' * 1_000_000}1", "base 60"),  # hours
        ("name: 0x" + "f" * 20_000, "valid string"),  # a number of too many digits to be shown
        ("name: " + "9" * 5000, "not valid YAML"),
        ('name: "\\ud800"', "not valid YAML"),
        ('"a\\nb": 1', "unknown key"),
        ('"\\e[2J": 1', "unknown key"),
        ("? " + "x" * 1_000_000 + "\n: 1", "unknown key"),
        ("a: &a [x]\nb: [*a, *a]", "aliases"),
        ("[" * 100_000, "nested too deeply"),
        ("a: " + "{a: " * 100_000, "nested too deeply"),
        ("- " * 100_000, "nested too deeply"),
        ("a: [" + "1," * 1_000_000 + "1]", "400,000 values"),
        ("name: many\ntargets: [" + "[0,0,0]," * 30_000 + "]", "at most 10000"),
        ("name: x\ntargets: [[1e308, 0, 0]]", "more than 1000 m away"),
        ("name: x\ntargets: [[.nan, 0, 0]]", "finite number"),
        ("name: x\ntargets: [[" + "9" * 400 + ", 0, 0]]", "target"),
        ("name: ../../x\ntargets: [[0, 0, 0]]", "pattern"),
        ("name: /etc/x\ntargets: [[0, 0, 0]]", "pattern"),
        ('name: "a\\nb"\ntargets: [[0, 0, 0]]', "pattern"),
        ("name: CON\ntargets: [[0, 0, 0]]", "Windows"),
        ("name: nul.x\ntargets: [[0, 0, 0]]", "Windows"),
        ("name: a.\ntargets: [[0, 0, 0]]", "Windows"),
    ],
    ids=lambda value: value[:30],
)
def test_documents_that_broke_something(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "task.yaml"
    file.write_text(text)
    with limited(), pytest.raises(TaskError, match=words) as refusal:
        load_task(file)
    assert str(refusal.value).isprintable()
    assert len(str(refusal.value)) <= 3000


def test_a_file_without_an_end_is_not_read_to_it(tmp_path: Path) -> None:
    for place in (Path("/dev/zero"), tmp_path / "big.yaml"):
        if place.parent == tmp_path:
            place.write_bytes(b" " * (LARGEST_DOCUMENT + 1))
        with limited(), pytest.raises(SpaceError, match="larger than 4 MiB"):
            load_space(place)
    with pytest.raises(SpaceError, match="cannot read"):
        load_space("a\0.yaml")


def test_ten_thousand_targets_are_read(tmp_path: Path) -> None:
    record = "{position: [0.1, 0.2, 0.3], axis: [0, 0, -1], tolerance: 0.002, angle_tolerance: 0.05, weight: 2}"
    file = tmp_path / "task.yaml"
    file.write_text("name: many\ntargets:\n" + f"  - {record}\n" * 10_000)
    with limited():
        assert len(load_task(file).targets) == 10_000


def test_an_experiment_of_too_many_cells(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text("name: x\ntasks: all\nseeds: 10000\nmethods: {a: {label: A}}\n")
    with limited(), pytest.raises(SettingsError, match="310,000 cells"):
        cells_of(*load_experiment(str(file)), tmp_path)


def test_an_experiment_whose_commands_are_no_lines(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text('name: x\ntasks: [target-1]\nseeds: 1\nmethods: {a: {label: A, proposer: llm, prompt: "a\\n"}}\n')
    with pytest.raises(SettingsError, match="can stand on no line") as refusal:
        cells_of(*load_experiment(str(file)), tmp_path)
    assert str(refusal.value).isprintable()


def test_a_range_from_zero_to_minus_zero(tmp_path: Path) -> None:
    file = tmp_path / "space.yaml"
    file.write_text("name: x\norigin_z: [0.0, -0.0]\n")
    assert [design.origin[2] for design in load_space(file).sample(3, 0)] == [0.0] * 3


def test_a_name_that_windows_takes_for_a_device_is_made_another() -> None:
    text = task_template(Path("con.yaml"))
    assert 'name: "task-con"' in text
    assert Task(name="console", targets=((0, 0, 0),)).name == "console"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A finished run, to be damaged."""
    return Path(shutil.copytree(a_run(), tmp_path / "run"))


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("verification",), 3), (("verification", "solid_numbers"), None), (("verification", "solid_numbers"), {}),
        (("hypervolume",), {}), (("hypervolume", "history"), [[1], 2]), (("hypervolume", "final"), "x"),
        (("credit",), []), (("credit", "bbo"), None), (("proposer", "failures"), 1), (("diagnostics",), "x"),
        (("seconds",), {}), (("best_known",), {"share": 1}), (("front_size",), 10**400), (("n_trials",), -1),
    ],
    ids=str,
)  # fmt: skip
def test_a_summary_that_is_none_is_made_anew(run: Path, place: tuple[str, ...], value: object) -> None:
    summary = json.loads((run / "summary.json").read_text())
    within = summary
    for key in place[:-1]:
        within = within[key]
    within[place[-1]] = value
    (run / "summary.json").write_text(json.dumps(summary))
    assert read_summary(run) is None
    looked_at(run)


@pytest.mark.parametrize("field", ["proposals", "memory", "answer", "name", "prompt"])
def test_settings_of_a_proposer_that_are_none(run: Path, field: str) -> None:
    text = (run / "config.yaml").read_text()
    assert f"    {field}: " in text
    lines = [line for line in text.splitlines() if not line.startswith(f"    {field}: ")]
    (run / "config.yaml").write_text("\n".join(lines))
    if field == "prompt":
        assert read_config(run).study.proposer is not None
    else:
        with pytest.raises(RunFolderError, match=field):
            read_config(run)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0, 3.0], [float("nan"), 1.0]], ids=str)
def test_arms_of_another_run(run: Path, values: list[float]) -> None:
    bought = json.loads((run / "bought.json").read_text())
    bought[0]["values"] = values
    (run / "bought.json").write_text(json.dumps(bought))
    with pytest.raises(RunFolderError, match="compare the arms again"):
        write_report(run)


@pytest.mark.parametrize("value", ["x", "llm-", "llm-x", "llm-9999999999", "-1\n"])
def test_calls_for_no_trial(run: Path, value: str) -> None:
    calls = [json.loads(line) for line in (run / "transcripts.jsonl").read_text().splitlines()]
    calls[1]["proposal"] = value
    (run / "transcripts.jsonl").write_text("".join(f"{json.dumps(call)}\n" for call in calls))
    with pytest.raises(RunFolderError, match="line 2 is damaged"):
        Transcript(run / "transcripts.jsonl")


@pytest.mark.parametrize("url", ["http://a:x/v1", "http://[::1", "http://", "http://\x01/v1", "http://a b/v1"])
def test_an_address_that_is_none(url: str) -> None:
    from armwright.llm.chat import ModelClient

    with pytest.raises(SettingsError, match="is no address"):
        ModelClient("openai-chat:x", url)


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"><link name="x"/></robot>',
        '<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot/>',
        '<!DOCTYPE r [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x"> %p;]><robot/>',
        "<a>" * 100_000,
        '<?xml version="1.0" encoding="utf-7"?><robot/>',
        "<robot><link name=\"${__import__('os').system('id')}\"/></robot>",
        '<robot xmlns:xacro="x"><xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/></robot>',
        '<robot><link name="a"><inertial><mass value="${1+1}"/></inertial></link></robot>',
        '<robot><xacro:include filename="/etc/passwd"/></robot>',
    ],
    ids=lambda text: text[:40],
)
def test_xml_that_is_no_arm(tmp_path: Path, text: str) -> None:
    """Entities are not declared, nothing is fetched, and xacro is not expanded."""
    file = tmp_path / "arm.urdf"
    file.write_text(text)
    with limited(), pytest.raises(ArmwrightError) as refusal:
        read_urdf(file)
    assert str(refusal.value).isprintable()


def test_what_does_not_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.fuzz.__main__.LONGEST", 0.05)

    def endless() -> None:
        with limited():
            while True:
                pass

    with pytest.raises(TooSlowError):
        endless()


@pytest.mark.parametrize("text", ["{{ " + "(" * 300 + "1" + ")" * 300 + " }}", "{{ " + "-" * 300 + "1 }}"])
def test_a_template_that_is_nested_too_deeply(tmp_path: Path, text: str) -> None:
    """Python refuses what jinja makes of it."""
    (tmp_path / "mine.md.j2").write_text(text)
    with limited(), suppress(SettingsError):
        load_prompt(tmp_path / "mine.md.j2")


def test_a_number_in_a_template_of_too_many_digits(tmp_path: Path) -> None:
    (tmp_path / "mine.md.j2").write_text("{{ " + "9" * 5000 + " }}")
    with pytest.raises(SettingsError, match="cannot be read: Exceeds the limit"):
        load_prompt(tmp_path / "mine.md.j2")

"""Drafting tasks and spaces over HTTP, against a local server."""

import json
import re
import threading
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

import armwright as aw
from armwright.exceptions import FailureError, ModelError, SettingsError
from armwright.llm.draft import DRAFTS, Draft
from armwright.llm.draft_prompt import MAX_DESCRIPTION_LENGTH, draft_prompt, draft_schema
from armwright.llm.prompt import MAX_TOKENS, estimated_tokens
from armwright.llm.transcript import Transcript
from armwright.problem.objectives import OBJECTIVES
from armwright.robot.actuators import catalogue
from armwright.yaml_documents import document_keys
from tests.support import wire_formats as wires
from tests.support.arms import LIGHT
from tests.support.chat_server import Answer, ChatServer, Request
from tests.support.command_line import PATIENCE, armwright, press_ctrl_c
from tests.support.wire_formats import model_options

DESCRIPTION = "paint a 1 × 2 m wall from a cart, payload 0.5 kg, cheap servos"
TASK = {
    "name": "wall",
    "description": "Paint a wall of 1 x 2 m from a cart.",
    "provenance": "From an engineer's words; the distance of the wall is assumed.",
    "targets": [[0.6, y, z] for z in (0.4, 1.4) for y in (-1.0, 0.0, 1.0)],
    "payload": 0.5,
    "objectives": ["worst_error", "torque_utilisation", "price"],
}
SPACE = {
    "name": "cart-arm",
    "joints": 5,
    "origin_z": [0.3, 0.3],
    "link": [0.1, 0.4],
    **LIGHT,
    "actuators": ["STS3215-12V", "XM430-W350"],
}
ASSUMPTIONS = ["the wall stands 0.6 m in front of the cart", "its lower edge is 0.4 m above the floor"]
FULL = {
    "reasoning": "The wall is wide.",
    "task": TASK,
    "space": SPACE,
    "assumptions": ASSUMPTIONS,
    "questions": ["how heavy is the cart?"],
}
PLAIN = {"reasoning": "", "task": {**TASK, "objectives": ["worst_error", "torque"]}, "assumptions": []}


def answer_with(content: Mapping[str, Any] = FULL, /, **parts: Mapping[str, Any] | None) -> str:
    """An answer with other values in its parts; None removes a key."""
    changed: dict[str, Any] = dict(content)
    for part, values in parts.items():
        merged = {**changed.get(part, {}), **(values or {})}
        changed[part] = {key: value for key, value in merged.items() if value is not None}
    return json.dumps(changed)


ANSWER = answer_with()


def drafted(
    server: ChatServer, answer: Answer | Iterable[Answer], out: Path | None = None, force: bool = False, **options: Any
) -> Draft:
    if isinstance(answer, (str, tuple, dict)):
        server.answer = lambda request: answer
    else:
        answers = iter(answer)
        server.answer = lambda request: next(answers)
    return aw.draft(
        DESCRIPTION, aw.ModelOptions(model="test-model", base_url=server.url, **options), out=out, force=force
    )


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("wire", "output"), [*((wire, "auto") for wire in wires.WIRES), *(("own server", form) for form in wires.OUTPUTS)]
)
def test_description_becomes_a_task_and_a_space(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wire: str, output: str
) -> None:
    for name, value in wires.environment(chat_server).items():
        monkeypatch.setenv(name, value)
    chat_server.answer = lambda request: ANSWER
    model = wires.WIRES[wire]
    options = aw.ModelOptions(model=model or "test-model", base_url=None if model else chat_server.url, output=output)
    draft = aw.draft(DESCRIPTION, options, out=tmp_path)
    assert [list(point) for point in draft.task.targets] == TASK["targets"]
    assert (draft.task.payload, draft.task.objectives) == (0.5, ("worst_error", "torque_utilisation", "price"))
    assert draft.task == aw.load_task(tmp_path / "wall.yaml")
    assert draft.space == aw.load_space(tmp_path / "wall-space.yaml")
    assert draft.space is not None
    assert [record.name for record in draft.space.actuators] == SPACE["actuators"]
    assert (draft.assumptions, draft.questions) == (tuple(ASSUMPTIONS), ("how heavy is the cart?",))
    assert draft.files == (tmp_path / "wall.yaml", tmp_path / "wall-space.yaml")
    assert files(tmp_path) == {"wall.yaml", "wall-space.yaml", DRAFTS}
    assert DESCRIPTION in chat_server.prompts()[0]
    assert (draft.usage.calls, draft.usage.input_tokens, draft.usage.output_tokens) == (1, 100, 20)
    (call,) = Transcript(tmp_path / DRAFTS).calls
    assert (call.step, json.loads(call.answer), call.origin, call.requests) == ("draft", FULL, "model", 1)


def test_draft_files_state_their_origin(chat_server: ChatServer, tmp_path: Path) -> None:
    draft = drafted(chat_server, ANSWER, tmp_path / "new folder")
    task, space = (path.read_text(encoding="utf-8") for path in draft.files)
    assert yaml.safe_load(task) == TASK
    assert yaml.safe_load(space) == SPACE
    for text, body in ((task, draft.task_yaml), (space, draft.space_yaml)):
        assert text.startswith("# A draft that nobody has checked: check the numbers")
        assert f"# From the description: {DESCRIPTION}\n" in text
        assert re.search(r"^# Drafted by test-model on \d{4}-\d\d-\d\d, armwright \d", text, re.MULTILINE)
        assert f"# Run it with:  {draft.command}\n" in text
        assert text.endswith(f"\n\n{body}")
    place = tmp_path / "new folder" / "wall"
    assert draft.command == f"armwright optimize '{place}.yaml' --space '{place}-space.yaml'"


@pytest.mark.parametrize(
    "space", [{}, {"space": None}, {"space": {"name": "any", "joints": 4}}], ids=["missing", "null", "default"]
)
def test_default_space_is_not_written(chat_server: ChatServer, tmp_path: Path, space: dict[str, Any]) -> None:
    draft = drafted(chat_server, json.dumps({**PLAIN, **space}), tmp_path)
    assert (draft.space, draft.problem.space) == (None, aw.paper_space())
    assert files(tmp_path) == {"wall.yaml", DRAFTS}
    assert "--space" not in draft.command


def test_keys_with_default_values_are_omitted(chat_server: ChatServer, tmp_path: Path) -> None:
    """Servers in strict mode fill every key."""
    filled = {**aw.Task.model_validate(TASK).model_dump(mode="json"), "workspace": []}
    draft = drafted(chat_server, json.dumps({**FULL, "task": filled}), tmp_path)
    assert yaml.safe_load(draft.task_yaml) == TASK


REFUSED = {
    "no task": ('{"reasoning": "I would rather talk about walls."}', "task: expected an object with the keys name"),
    "unknown key": (answer_with(task={"paylod": 1}), 'task: unknown key "paylod"'),
    "payloads": (answer_with(task={"payload": [0.5, 0.5]}), "payload: expected 1 or 6 values [kg], got 2"),
    "actuators missing": (json.dumps({**FULL, "space": None}), "needs actuators"),
    "built-in name": (answer_with(task={"name": "shelf"}), '"shelf" is that of a built-in task'),
    "no provenance": (answer_with(task={"provenance": None}), "provenance is missing"),
    # Hostile, or near it.
    "path": (answer_with(task={"name": "../../etc/wall"}), "task: name: expected a name of at most 64 letters"),
    "long name": (answer_with(task={"name": "w" * 300}), "task: name: expected a name of at most 64 letters"),
    "too long": (answer_with(task={"targets": [[0, 0, 0]] * 10_001}), "task: expected an object"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.fast_cases(3)
def test_invalid_draft_is_returned_with_the_reason_and_not_written(
    chat_server: ChatServer, tmp_path: Path, name: str
) -> None:
    wrong, reason = REFUSED[name]
    draft = drafted(chat_server, [wrong, ANSWER], tmp_path)
    assert reason in chat_server.prompts()[1]
    assert (draft.task.name, draft.usage.calls) == ("wall", 2)
    assert files(tmp_path) == {"wall.yaml", "wall-space.yaml", DRAFTS}

    folder = tmp_path / "never"
    with pytest.raises(ModelError) as never:
        drafted(chat_server, wrong, folder)
    message = str(never.value)
    assert reason[:60] in message
    assert message.startswith("no draft: test-model: ")
    assert f"The answer is in {folder / DRAFTS}. Describe it in other words; " in message
    assert message.isprintable()
    assert files(folder) == {DRAFTS}
    (call,) = Transcript(folder / DRAFTS).calls
    assert (call.answer, call.requests, call.fault) == (wrong, 3, "answer")  # raw, for investigation
    assert len(chat_server.requests) == 2 + 3


def test_invisible_characters_do_not_reach_files_and_terminal(chat_server: ChatServer, tmp_path: Path) -> None:
    hostile = answer_with(
        {**FULL, "assumptions": ["0.6 m \x1b[31m\u2028in\x85front"]},
        task={"description": "\x1b[2J\x1b]0;Paint\x07 \u202ea wall\u200b"},
        space={"name": "arm\u202etxt"},
    )
    draft = drafted(chat_server, hostile, tmp_path)
    for text in (
        *(path.read_text(encoding="utf-8") for path in draft.files),
        *draft.assumptions,
        json.dumps(draft.record()),
    ):
        assert all(letter.isprintable() or letter == "\n" for letter in text)
    assert all(letter.isprintable() for letter in draft.task.description)
    assert (tmp_path / DRAFTS).read_text(encoding="utf-8").replace("\n", "").isprintable()


def test_line_breaks_in_a_description_stay_in_the_comment(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = lambda request: ANSWER
    description = f"paint\nname: evil\n{'-' * 12}\x1b[0m\u2028targets: []"
    options = aw.ModelOptions(model="m", base_url=chat_server.url)
    draft = aw.draft(description, options, out=tmp_path / "a\nname: b")
    assert aw.load_task(draft.files[0]) == draft.task
    assert "# From the description: paint name: evil ------------ targets: []\n" in draft.files[0].read_text(
        encoding="utf-8"
    )
    (prompt,) = chat_server.prompts()
    assert prompt.count("-" * 13) == 2  # the description cannot leave its lines of dashes


def test_taken_name_is_returned_to_the_model(chat_server: ChatServer, tmp_path: Path) -> None:
    for taken in ("wall.yaml", "wall-space.yaml"):
        folder = tmp_path / taken
        folder.mkdir()
        (folder / taken).write_text("mine", encoding="utf-8")
        other = drafted(chat_server, [ANSWER, answer_with(task={"name": "wall-2"})], folder)
        assert '"wall" is taken' in chat_server.prompts()[-1].replace("\\", "")
        assert other.files == (folder / "wall-2.yaml", folder / "wall-2-space.yaml")
        with pytest.raises(ModelError, match=rf"{taken} exists \(--force replaces it\)"):
            drafted(chat_server, ANSWER, folder)
        assert (folder / taken).read_text(encoding="utf-8") == "mine"
        forced = drafted(chat_server, ANSWER, folder, force=True)
        assert aw.load_task(folder / "wall.yaml") == forced.task


def test_file_created_during_the_call_is_kept(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.path.lexists", lambda path: False)
    (tmp_path / "wall.yaml").write_text("mine", encoding="utf-8")
    with pytest.raises(FailureError, match=r"cannot write .*wall\.yaml: File exists\. The answer is in"):
        drafted(chat_server, ANSWER, tmp_path)
    assert (tmp_path / "wall.yaml").read_text(encoding="utf-8") == "mine"


def test_scripted_draft_is_not_attributed_to_a_model(chat_server: ChatServer, tmp_path: Path) -> None:
    draft = drafted(chat_server, ANSWER, tmp_path, origin="scripted")
    assert draft.by == "a scripted stand-in for a model (test-model)"
    assert draft.record()["origin"] == draft.usage.origin == "scripted"
    assert all(draft.by in path.read_text(encoding="utf-8") for path in draft.files)
    assert [call.origin for call in Transcript(tmp_path / DRAFTS).calls] == ["scripted"]


def test_calls_of_a_draft_are_bounded(chat_server: ChatServer, tmp_path: Path) -> None:
    for most in (1, 2):
        before = len(chat_server.requests)
        with pytest.raises(ModelError, match=r'unknown key "paylod"'):
            drafted(chat_server, REFUSED["unknown key"][0], tmp_path, max_calls=most)
        assert len(chat_server.requests) == before + most
    draft = drafted(chat_server, ANSWER, tmp_path, max_calls=1)
    assert (draft.usage.calls, draft.usage.input_tokens) == (1, 100)
    calls = Transcript(tmp_path / DRAFTS).calls
    assert [(call.proposal, call.fault) for call in calls] == [
        ("draft-0001", "limit"), ("draft-0002", "limit"), ("draft-0003", None)
    ]  # fmt: skip


def test_cost_of_a_draft_is_bounded_by_public_prices(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in wires.environment(chat_server).items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SettingsError, match="the price of test-model is unknown; use max_calls"):
        drafted(chat_server, ANSWER, tmp_path, max_cost=1.0)
    with pytest.raises(SettingsError, match=r"a draft takes about 0\.0\d+ USD, more than max_cost = 0\.001"):
        aw.draft(DESCRIPTION, aw.ModelOptions(model="openai-chat:gpt-4o", max_cost=0.001), out=tmp_path)
    assert chat_server.requests == []
    chat_server.answer = lambda request: ANSWER
    draft = aw.draft(DESCRIPTION, aw.ModelOptions(model="openai-chat:gpt-4o", max_cost=0.5), out=tmp_path)
    assert draft.usage.cost_usd is not None
    assert 0.0 < draft.usage.cost_usd < 0.01


@pytest.mark.parametrize("description", ["", " \n ", "\x1b[0m"])
def test_empty_and_overlong_descriptions_are_refused(chat_server: ChatServer, description: str) -> None:
    options = aw.ModelOptions(model="m", base_url=chat_server.url)
    with pytest.raises(SettingsError, match="the description is empty"):
        aw.draft(description, options)
    with pytest.raises(SettingsError, match="expected at most 10,000"):
        aw.draft("w" * (MAX_DESCRIPTION_LENGTH + 1), options)
    assert chat_server.requests == []


def test_draft_command_writes_files_and_json(chat_server: ChatServer, in_folder: Path) -> None:
    chat_server.answer = lambda request: ANSWER
    server = (*model_options(base_url=chat_server.url), "--model", "test-model")
    done = armwright("draft", *DESCRIPTION.split(), *server)  # without quotes, too
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0].startswith(f"asking test-model at {chat_server.url}, named by --model: about ")
    assert "6 targets [m]" in done.stdout
    assert ASSUMPTIONS[0] in done.stdout
    assert "how heavy is the cart?" in done.stdout
    assert files(in_folder) == {"wall.yaml", "wall-space.yaml", DRAFTS}  # nothing was run

    short = ("--n-init", "2", "--n-total", "1", "--no-figures")
    for line, more in zip(lines[-2:], ((), short), strict=True):
        assert armwright(*line.split()[1:], *more).returncode == 0
    taken = armwright("draft", DESCRIPTION, *server, "--json")
    assert (taken.returncode, taken.stdout) == (1, "")
    assert "wall.yaml exists (--force replaces it)" in taken.stderr
    record = json.loads(armwright("draft", DESCRIPTION, *server, "--force", "--json").stdout)
    assert (record["files"], record["calls"]) == (["wall.yaml", "wall-space.yaml"], 1)
    assert (record["task"]["payload"], record["assumptions"]) == (0.5, ASSUMPTIONS)


def test_draft_prompt_is_shown_without_a_model(in_folder: Path) -> None:
    done = armwright("draft", DESCRIPTION, "--print-prompt")
    shown = f"{draft_prompt(DESCRIPTION)}\n{json.dumps(draft_schema(), indent=2)}\n"
    assert (done.returncode, done.stderr, done.stdout) == (0, "", shown)
    assert files(in_folder) == set()


@pytest.mark.parametrize("refused", [0, 1])
def test_ctrl_c_cancels_the_draft_and_writes_no_task(chat_server: ChatServer, in_folder: Path, refused: int) -> None:
    released = threading.Event()

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) <= refused:
            return "no task"
        press_ctrl_c()
        released.wait(PATIENCE)
        return ANSWER

    chat_server.answer = answer
    done = armwright("draft", DESCRIPTION, "--model", "m", *model_options(base_url=chat_server.url))
    assert not released.is_set()
    released.set()
    assert (done.returncode, done.stderr) == (130, "")
    assert done.stdout.endswith("\nstopped; no task was written\n")
    assert files(in_folder) == ({DRAFTS} if refused else set())


def test_draft_prompt_covers_all_file_keys() -> None:
    prompt, schema = draft_prompt(DESCRIPTION), draft_schema()
    for model in (aw.Task, aw.DesignSpace):
        assert set(schema["$defs"][model.__name__]["properties"]) == set(document_keys(model)) - {"parameters"}
    for objective in OBJECTIVES.values():
        assert f"- {objective.name} [{objective.unit}]: " in prompt
    names = schema["$defs"]["DesignSpace"]["properties"]["actuators"]["items"]["enum"]
    assert names == list(catalogue())
    assert all(f"- {name} (" in prompt for name in names)
    assert "prefixItems" not in json.dumps(schema["$defs"]["Task"])
    assert estimated_tokens(prompt + json.dumps(schema)) < MAX_TOKENS

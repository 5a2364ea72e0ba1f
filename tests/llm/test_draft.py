"""Tasks and spaces drafted from words, over the real protocols, against a server of our own on 127.0.0.1."""

import json
import re
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

import armwright as aw
from armwright.exceptions import FailureError, ModelError, SettingsError, TaskError
from armwright.llm.draft import DRAFTS, Draft
from armwright.llm.draft_prompt import LONGEST_WORDS, SPACE_EXAMPLE, draft_prompt, read_documents
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import MOST_TOKENS, estimated_tokens
from armwright.llm.transcript import Transcript
from armwright.problem.objectives import OBJECTIVES
from armwright.robot.actuators import catalogue
from armwright.tasks.task_template import task_template
from tests.support import wire_formats as wires
from tests.support.chat_server import Answer, ChatServer, Request
from tests.support.command_line import PATIENCE, armwright, press_ctrl_c, refused
from tests.support.model_faults import FAULTS
from tests.support.wire_formats import model_options

WORDS = "paint a 1 × 2 m wall from a cart, payload 0.5 kg, cheap servos"
TASK = """\
name: wall
description: Paint a wall of 1 x 2 m from a cart.
provenance: From an engineer's words; the distance of the wall is assumed.
targets:
  - [0.6, -1.0, 0.4]     # the lower edge
  - [0.6, 0.0, 0.4]
  - [0.6, 1.0, 0.4]
  - [0.6, -1.0, 1.4]
  - [0.6, 0.0, 1.4]
  - [0.6, 1.0, 1.4]
payload: 0.5
objectives: [worst_error, torque_utilisation, price]
"""
SPACE = """\
name: cart-arm
joints: 5
origin_z: [0.3, 0.3]     # the cart's platform
link: [0.1, 0.4]
actuators: [STS3215-12V, XM430-W350]
"""
ASSUMED = """\
- the wall stands 0.6 m in front of the cart
- its lower edge is 0.4 m above the floor,
  as a skirting board is lower
"""
ANSWER = f"The wall is wide.\n\nTASK\n```yaml\n{TASK}```\nSPACE\n```yaml\n{SPACE}```\nASSUMED\n{ASSUMED}"
ALONE = f"TASK\n```yaml\n{TASK.replace('[worst_error, torque_utilisation, price]', '[worst_error, torque]')}```\n"


def drafted(
    server: ChatServer, answer: Answer | Iterable[Answer], out: Path | None = None, force: bool = False, **options: Any
) -> Draft:
    if isinstance(answer, (str, tuple, dict)):
        server.answer = lambda request: answer
    else:
        answers = iter(answer)
        server.answer = lambda request: next(answers)
    return aw.draft(WORDS, ModelOptions(model="test-model", base_url=server.url, **options), out=out, force=force)


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize("wire", wires.WIRES)
def test_words_become_a_task_and_a_space(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wire: str
) -> None:
    for name, value in wires.environment(chat_server).items():
        monkeypatch.setenv(name, value)
    chat_server.answer = lambda request: ANSWER
    model = wires.WIRES[wire]
    options = ModelOptions(model=model or "test-model", base_url=None if model else chat_server.url)
    draft = aw.draft(WORDS, options, out=tmp_path)
    task, space = (yaml.safe_load(text) for text in (TASK, SPACE))
    assert [list(point) for point in draft.task.targets] == task["targets"]
    assert draft.task == aw.load_task(tmp_path / "wall.yaml")
    assert (draft.task.payload, draft.task.objectives) == (0.5, tuple(task["objectives"]))
    assert draft.space == aw.load_space(tmp_path / "wall-space.yaml")
    assert [record.name for record in draft.space.actuators] == space["actuators"]
    assert draft.problem.evaluate(draft.problem.space.sample(2, 0)).values.shape == (2, 3)
    assert draft.assumed == (
        "the wall stands 0.6 m in front of the cart",
        "its lower edge is 0.4 m above the floor, as a skirting board is lower",
    )
    assert draft.files == (tmp_path / "wall.yaml", tmp_path / "wall-space.yaml")
    assert files(tmp_path) == {"wall.yaml", "wall-space.yaml", DRAFTS}
    assert WORDS in chat_server.prompts()[0]
    assert (draft.account.calls, draft.account.input_tokens, draft.account.output_tokens) == (1, 100, 20)
    (call,) = Transcript(tmp_path / DRAFTS).calls
    assert (call.step, call.answer, call.origin, call.requests) == ("draft", ANSWER, "model", 1)


def test_the_files_say_what_they_are_and_keep_the_reasons(chat_server: ChatServer, tmp_path: Path) -> None:
    draft = drafted(chat_server, ANSWER, tmp_path / "new folder")
    task, space = (path.read_text() for path in draft.files)
    assert task.endswith(TASK)
    assert space.endswith(SPACE)
    for text in (task, space):
        assert text.startswith("# A draft that nobody has checked: check the numbers")
        assert f"# From the words: {WORDS}\n" in text
        assert re.search(r"^# Drafted by test-model on \d{4}-\d\d-\d\d, armwright \d", text, re.MULTILINE)
        assert f"# Run it with:  {draft.command}\n" in text
    assert "# - the wall stands 0.6 m in front of the cart\n" in task
    assert draft.space_body == SPACE
    place = tmp_path / "new folder" / "wall"
    assert draft.command == f"armwright optimize '{place}.yaml' --space '{place}-space.yaml'"


def test_without_a_folder_nothing_is_written(chat_server: ChatServer, in_folder: Path) -> None:
    draft = drafted(chat_server, ANSWER)
    assert (files(in_folder), draft.files) == (set(), ())
    assert draft.command == "armwright optimize wall.yaml --space wall-space.yaml"


@pytest.mark.parametrize(
    "space",
    ["", "SPACE\n```yaml\nname: any\njoints: 4\nlink: [0.03, 0.3]\n```\n", "SPACE\n```yaml\n# the default fits\n```\n"],
    ids=["none", "default", "empty"],
)
def test_a_space_that_is_the_default_is_no_file(chat_server: ChatServer, tmp_path: Path, space: str) -> None:
    draft = drafted(chat_server, ALONE + space, tmp_path)
    assert (draft.space, draft.problem.space) == (None, aw.paper_space())
    assert files(tmp_path) == {"wall.yaml", DRAFTS}
    assert "--space" not in draft.command


AS_JSON = f"{json.dumps(yaml.safe_load(TASK), indent=1)}\n---\n{json.dumps(yaml.safe_load(SPACE))}"
FORMS = {
    "fenced": ANSWER,
    "fenced without names": ANSWER.replace("```yaml", "```"),
    "tildes": ANSWER.replace("```yaml", "~~~yml").replace("```", "~~~"),
    "headings": ANSWER.replace("TASK\n", "## Task\n")
    .replace("SPACE\n", "**SPACE**:\n")
    .replace("ASSUMED", "### Assumed"),
    "unfenced": f"Here it is:\n\nTASK\n{TASK}\nSPACE\n{SPACE}\nASSUMED\n{ASSUMED}",
    "documents": f"{TASK}---\n{SPACE}",
    "documents in one block": f"```yaml\n---\n{TASK}---\n{SPACE}```\n",
    "under keys": f"task:\n{'  '.join(['', *TASK.splitlines(True)])}space:\n{'  '.join(['', *SPACE.splitlines(True)])}",
    "JSON": AS_JSON,
    "fenced JSON": f"```json\n{AS_JSON}\n```",
    "thoughts before": f"<think>TASK\n```yaml\n{TASK.replace('0.6', '9.9')}```\n</think>{ANSWER}",
    "a first try before": f"TASK\n```yaml\n{TASK.replace('0.6', '9.9')}```\nToo far. So:\n{ANSWER}",
    "commands after": f"{ANSWER}\n```sh\narmwright optimize wall.yaml\n```\nI hope this helps: enjoy.",
    "keys in the words after": f"{ANSWER}\npayload: I took that from your words.\n",
    "indented": "\n".join(f"   {line}" for line in ANSWER.splitlines()),
    "Windows": ANSWER.replace("\n", "\r\n"),
    "space first": f"SPACE\n```yaml\n{SPACE}```\nTASK\n```yaml\n{TASK}```\n",
}


@pytest.mark.parametrize("form", FORMS)
def test_the_form_of_an_answer_is_free(chat_server: ChatServer, tmp_path: Path, form: str) -> None:
    draft = drafted(chat_server, FORMS[form], tmp_path)
    plain = drafted(chat_server, ANSWER)
    assert (draft.task, draft.space) == (plain.task, plain.space)
    assert (aw.load_task(draft.files[0]), aw.load_space(draft.files[1])) == (plain.task, plain.space)
    assert draft.account.calls == 1


LAUGHS = "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n"
REFUSED = {
    "no task": ("I would rather talk about walls.", "no task found: give it as one block of YAML with these keys"),
    "space alone": (f"```yaml\n{SPACE}```", "no task found"),
    "cut short": (ANSWER[: ANSWER.index("payload")], "the answer is cut short"),
    "no YAML": (ANSWER.replace("payload: 0.5", "payload: [0.5"), "the task is not valid YAML"),
    "unknown key": (ANSWER.replace("payload:", "paylod:"), 'the task: unknown key "paylod"'),
    "did you mean": (ANSWER.replace("payload:", "paylod:"), 'Did you mean "payload"?'),
    "far away": (ANSWER.replace("0.6, 0.0, 0.4", "6000, 0, 0.4"), "is more than 1000 m away"),
    "not finite": (ANSWER.replace("0.6, 0.0, 0.4", ".nan, 0, 0.4"), "targets[1][0]: Input should be a finite number"),
    "no name": (ANSWER.replace("name: wall\n", ""), "the task: name: Field required"),
    "payloads": (ANSWER.replace("payload: 0.5", "payload: [0.5, 0.5]"), "payload: expected 1 or 6 values [kg], got 2"),
    "unknown objective": (ANSWER.replace("torque_utilisation", "torque_used"), 'unknown objective "torque_used"'),
    "reference point": (
        ANSWER.replace("payload:", "reference_point: [1.0, 1.0]\npayload:"),
        "the problem minimises 3: worst_error, torque_utilisation, price",
    ),
    "unknown actuator": (ANSWER.replace("XM430-W350", "XM430-W351"), 'unknown actuator "XM430-W351"'),
    "actuators missing": (ANSWER[: ANSWER.index("SPACE")], "objective torque_utilisation needs actuators"),
    "price missing": (ANSWER.replace("XM430-W350", "MG996R"), "objective price needs the price of every actuator"),
    "torque missing": (ANSWER.replace("XM430-W350", "AK60-6"), "actuator AK60-6 has no stall torque"),
    "range": (ANSWER.replace("[0.1, 0.4]", "[0.4, 0.1]"), "is reversed"),
    "default's name": (ANSWER.replace("name: cart-arm", "name: paper"), "the space needs a name of its own"),
    "built-in name": (ANSWER.replace("name: wall", "name: shelf"), '"shelf" is that of a built-in task'),
    "no provenance": (re.sub("provenance.*\n", "", ANSWER), "provenance is missing"),
    # Hostile, or near it.
    "path": (ANSWER.replace("name: wall", "name: ../../etc/wall"), "the task: name: String should match pattern"),
    "absolute path": (ANSWER.replace("name: wall", "name: /etc/passwd"), "the task: name: String should match pattern"),
    "dotfile": (ANSWER.replace("name: wall", "name: .bashrc"), "the task: name: String should match pattern"),
    "long name": (ANSWER.replace("name: wall", f"name: {'w' * 300}"), "the task: name: String should match pattern"),
    "tag": (
        ANSWER.replace("payload: 0.5", 'payload: !!python/object/apply:os.system ["touch hacked"]'),
        "tags (tag:yaml.org,2002:python/object/apply:os.system) are not allowed",
    ),
    "bomb": (ANSWER.replace("payload: 0.5", LAUGHS), "anchors and aliases (&, *) are not allowed"),
    "deep": (ANSWER.replace("payload: 0.5", f"payload: {'[' * 20_000}"), "the task is not valid YAML"),
    "huge": (ANSWER.replace("Paint", "Paint " * 30_000), "characters; at most 100,000 are read"),
    "many targets": (ANSWER.replace("  - [0.6, 0.0, 0.4]\n", "  - [0, 0, 0]\n" * 5_000 * 2), "characters; at most"),
    "huge number": (ANSWER.replace("payload: 0.5", f"payload: {'9' * 6000}"), "the task"),
    "escape in quotes": (ANSWER.replace("Paint a wall of 1 x 2 m from a cart.", r'"\e[31mred"'), "control characters"),
    "backwards in quotes": (
        ANSWER.replace("name: cart-arm", r'name: "arm\u202Etxt"'),
        r"control characters are not allowed: 'arm\u202etxt'",
    ),
    "key twice": (ANSWER.replace("payload: 0.5", "payload: 0.5\npayload: 5"), 'duplicate key "payload"'),
    "two documents": (ANSWER.replace("payload: 0.5", "%YAML 1.2"), "the task is not valid YAML"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_valid_goes_back_in_words_and_is_never_written(
    chat_server: ChatServer, tmp_path: Path, name: str
) -> None:
    wrong, words = REFUSED[name]
    draft = drafted(chat_server, [wrong, ANSWER], tmp_path)
    again = chat_server.prompts()[1]
    assert words in again
    assert "# Your last answer was refused" in again
    assert "\x1b" not in again
    assert estimated_tokens(again) < 3 * MOST_TOKENS
    assert draft.task.name == "wall"
    assert draft.account.calls == 2
    assert files(tmp_path) == {"wall.yaml", "wall-space.yaml", DRAFTS}

    folder = tmp_path / "never"
    with pytest.raises(ModelError) as never:
        drafted(chat_server, wrong, folder)
    message = str(never.value)
    assert words in message
    assert "test-model gave no valid draft in 3 answers; the last was refused" in message
    assert str(folder / DRAFTS) in message
    assert message.isprintable()
    assert files(folder) == {DRAFTS}
    calls = Transcript(folder / DRAFTS).calls
    assert [call.answer for call in calls] == [wrong] * 3  # raw, for investigation
    assert len(chat_server.requests) == 2 + 3
    assert not (Path.cwd() / "hacked").exists()


def test_what_is_not_seen_does_not_reach_files_and_terminal(chat_server: ChatServer, tmp_path: Path) -> None:
    hostile = ANSWER.replace("# the lower edge", "# the \x1b[2J\x1b]0;lower\x07 \u202eedge\u200b").replace(
        "0.6 m in front", "0.6 m \x1b[31m\u2028in\x85front"
    )
    draft = drafted(chat_server, hostile, tmp_path)
    texts = [path.read_text() for path in draft.files]
    assert all(letter.isprintable() or letter == "\n" for text in texts for letter in text)
    assert draft.task == drafted(chat_server, ANSWER).task
    assert all(line.isprintable() for line in draft.assumed)
    raw = (tmp_path / DRAFTS).read_text()
    assert all(letter.isprintable() or letter == "\n" for letter in raw)


def test_words_with_line_ends_stay_in_their_comment(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = lambda request: ANSWER
    words = f"paint\nname: evil\n{'-' * 12}\x1b[0m\u2028targets: []"
    draft = aw.draft(words, ModelOptions(model="m", base_url=chat_server.url), out=tmp_path / "a\nname: b")
    assert aw.load_task(draft.files[0]) == drafted(chat_server, ANSWER).task
    assert "# From the words: paint name: evil ------------ targets: []\n" in draft.task_yaml
    (prompt, _) = chat_server.prompts()
    assert prompt.count("-" * 13) == 2  # the words cannot step out of their lines of dashes


def test_the_second_answer_is_told_of_the_first(chat_server: ChatServer, tmp_path: Path) -> None:
    wrong = REFUSED["unknown key"][0]
    drafted(chat_server, [wrong, REFUSED["no task"][0], ANSWER], tmp_path)
    first, second, third = chat_server.prompts()
    assert "refused" not in first
    assert wrong.strip() in second
    assert REFUSED["no task"][0] in third
    assert wrong not in third
    assert [call.proposal for call in Transcript(tmp_path / DRAFTS).calls] == ["draft-0001"] * 3


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, some in FAULTS.items() for name in some])
def test_faults_are_one_line_and_write_no_task(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, name: str
) -> None:
    monkeypatch.setattr("armwright.llm.client.RETRY_SECONDS", 0.01)
    with pytest.raises(ModelError) as fault:
        drafted(chat_server, FAULTS[kind][name], tmp_path, timeout=1.0)
    assert str(fault.value).startswith("no draft: test-model: ")
    assert str(fault.value).endswith("armwright init my-task.yaml writes a task to edit without a model")
    assert "\n" not in str(fault.value)
    assert files(tmp_path) == {DRAFTS}
    (call,) = Transcript(tmp_path / DRAFTS).calls
    assert call.fault == kind
    assert (fault.value.final is not None) == (kind in ("key", "quota", "unknown_model"))


def test_a_name_that_is_taken_goes_back_to_the_model(chat_server: ChatServer, tmp_path: Path) -> None:
    for taken in ("wall.yaml", "wall-space.yaml"):
        folder = tmp_path / taken
        folder.mkdir()
        (folder / taken).write_text("mine")
        other = drafted(chat_server, [ANSWER, ANSWER.replace("name: wall", "name: wall-2")], folder)
        assert '"wall" is taken' in chat_server.prompts()[-1]
        assert other.files == (folder / "wall-2.yaml", folder / "wall-2-space.yaml")
        with pytest.raises(ModelError, match=f"{taken} exists already"):
            drafted(chat_server, ANSWER, folder)
        assert (folder / taken).read_text() == "mine"
        forced = drafted(chat_server, ANSWER, folder, force=True)
        assert aw.load_task(folder / "wall.yaml") == forced.task


def test_a_link_that_leads_nowhere_is_a_taken_name(chat_server: ChatServer, tmp_path: Path) -> None:
    (tmp_path / "wall.yaml").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ModelError, match="is taken"):
        drafted(chat_server, ANSWER, tmp_path)
    assert not (tmp_path / "elsewhere").exists()


def test_a_file_that_appears_meanwhile_is_kept(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.path.lexists", lambda path: False)
    (tmp_path / "wall.yaml").write_text("mine")
    with pytest.raises(FailureError, match=r"cannot write .*wall\.yaml: File exists\. What it said is in"):
        drafted(chat_server, ANSWER, tmp_path)
    assert (tmp_path / "wall.yaml").read_text() == "mine"


def test_a_folder_that_cannot_be_is_known_before_anything_is_asked(chat_server: ChatServer, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FailureError, match="cannot write"):
        drafted(chat_server, ANSWER, tmp_path / "file")
    assert chat_server.requests == []


def test_a_scripted_answer_is_never_a_models(chat_server: ChatServer, tmp_path: Path) -> None:
    draft = drafted(chat_server, ANSWER, tmp_path, origin="scripted")
    assert draft.by == "a scripted stand-in for a model (test-model)"
    assert draft.record()["origin"] == draft.account.origin == "scripted"
    for path in draft.files:
        assert "# Drafted by a scripted stand-in for a model (test-model) on" in path.read_text()
    assert [call.origin for call in Transcript(tmp_path / DRAFTS).calls] == ["scripted"]
    with pytest.raises(ModelError, match="a scripted stand-in for a model"):
        drafted(chat_server, "no", tmp_path, origin="scripted")
    with pytest.raises(ValidationError, match='unknown origin "robot"'):
        drafted(chat_server, ANSWER, tmp_path, origin="robot")


def test_calls_are_bounded_each_draft_by_itself(chat_server: ChatServer, tmp_path: Path) -> None:
    wrong = REFUSED["unknown key"][0]
    for most in (1, 2):
        before = len(chat_server.requests)
        with pytest.raises(ModelError, match=f'unknown key "paylod".*max_calls {most} is used up') as fault:
            drafted(chat_server, wrong, tmp_path, max_calls=most)
        assert fault.value.final == "budget"
        assert len(chat_server.requests) == before + most
    draft = drafted(chat_server, ANSWER, tmp_path, max_calls=1)
    assert (draft.account.calls, draft.account.input_tokens) == (1, 100)
    assert [call.proposal for call in Transcript(tmp_path / DRAFTS).calls] == [
        "draft-0001", "draft-0002", "draft-0002", "draft-0003"
    ]  # fmt: skip


def test_costs_are_bounded_by_public_prices(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in wires.environment(chat_server).items():
        monkeypatch.setenv(name, value)
    chat_server.answer = lambda request: REFUSED["unknown key"][0]
    with pytest.raises(SettingsError, match="the price of test-model is not known, so max_cost = 1 cannot hold"):
        drafted(chat_server, ANSWER, tmp_path, max_cost=1.0)
    with pytest.raises(SettingsError, match=r"a draft takes about 0\.0\d+ USD, more than max_cost = 0\.001"):
        aw.draft(WORDS, ModelOptions(model="openai-chat:gpt-4o", max_cost=0.001), out=tmp_path)
    assert chat_server.requests == []
    chat_server.answer = lambda request: ANSWER
    draft = aw.draft(WORDS, ModelOptions(model="openai-chat:gpt-4o", max_cost=0.5), out=tmp_path)
    assert draft.account.cost_usd is not None
    assert 0.0 < draft.account.cost_usd < 0.01


def test_without_a_model_there_is_one_error_that_says_what_to_do(in_folder: Path) -> None:
    message = refused(2, "draft", WORDS)
    for words in ("--model openai-chat:gpt-4o", "ARMWRIGHT_MODEL", "config.yaml", "armwright init my-task.yaml"):
        assert words in message
    assert files(in_folder) == set()
    with pytest.raises(SettingsError, match="a draft needs a language model"):
        aw.draft(WORDS)


@pytest.mark.parametrize("words", ["", " \n ", "\x1b[0m"])
def test_no_words_are_refused(chat_server: ChatServer, words: str) -> None:
    with pytest.raises(SettingsError, match="there are no words to draft from"):
        aw.draft(words, ModelOptions(model="m", base_url=chat_server.url))
    with pytest.raises(SettingsError, match="at most 10,000 are taken"):
        aw.draft("w" * (LONGEST_WORDS + 1), ModelOptions(model="m", base_url=chat_server.url))
    assert chat_server.requests == []


def test_the_command_line(chat_server: ChatServer, in_folder: Path) -> None:
    chat_server.answer = lambda request: ANSWER
    server = (*model_options(base_url=chat_server.url), "--model", "test-model")
    done = armwright("draft", *WORDS.split(), *server)  # without quotes, too
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0].startswith(f"asking test-model at {chat_server.url}, named by --model: about ")
    assert lines[0].endswith("up to 3 times; on a server of your own")
    assert "  6 targets [m]: (0.6, -1, 0.4) (0.6, 0, 0.4)" in done.stdout
    assert "  origin_z: [0.3, 0.3]     # the cart's platform\n" in done.stdout
    assert "  - the wall stands 0.6 m in front of the cart\n" in done.stdout
    assert "test-model: 1 call, 100 tokens in, 20 out, cost unknown" in done.stdout
    assert "wrote wall.yaml and wall-space.yaml: a draft. Check the numbers" in done.stdout
    assert lines[-1] == "  armwright optimize wall.yaml --space wall-space.yaml"
    assert files(in_folder) == {"wall.yaml", "wall-space.yaml", DRAFTS}  # nothing was run
    assert WORDS in chat_server.prompts()[0]

    short = ("--n-init", "2", "--n-total", "1", "--no-figures")
    for line, more in zip(lines[-2:], ((), short), strict=True):
        assert armwright(*line.split()[1:], *more).returncode == 0
    taken = armwright("draft", WORDS, *server, "--json")
    assert (taken.returncode, taken.stdout) == (1, "")
    asking, error = taken.stderr.splitlines()
    assert asking.startswith("asking test-model")
    assert "wall.yaml exists already" in error
    assert error.endswith("--force replaces files; --out names another folder")
    forced = armwright(
        "draft",
        WORDS,
        "--model",
        "test-model",
        "--force",
        "--json",
        *model_options(base_url=chat_server.url, origin="scripted"),
    )
    record = json.loads(forced.stdout)
    assert (record["files"], record["origin"], record["calls"]) == (["wall.yaml", "wall-space.yaml"], "scripted", 1)
    assert record["task"]["payload"] == 0.5
    assert "a scripted stand-in" in forced.stderr


def test_what_would_be_sent_is_shown_without_a_model(in_folder: Path) -> None:
    done = armwright("draft", WORDS, "--print-prompt")
    assert (done.returncode, done.stderr, done.stdout) == (0, "", draft_prompt(WORDS))
    assert files(in_folder) == set()


@pytest.mark.parametrize("refused", [0, 1])
def test_ctrl_c_ends_the_call_and_writes_no_task(chat_server: ChatServer, in_folder: Path, refused: int) -> None:
    released = threading.Event()

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) <= refused:
            return "no task"
        press_ctrl_c()
        released.wait(PATIENCE)
        return ANSWER

    chat_server.answer = answer
    done = armwright("draft", WORDS, "--model", "m", *model_options(base_url=chat_server.url))
    released.set()
    assert (done.returncode, done.stderr) == (130, "")
    assert done.stdout.endswith("\nstopped; no task was written\n")
    assert files(in_folder) == ({DRAFTS} if refused else set())


def test_the_prompt_knows_all_that_the_files_may_hold() -> None:
    prompt = draft_prompt(WORDS)
    for name in (*aw.Task.model_fields, *aw.DesignSpace.model_fields):
        assert f'"{name}": {{' in prompt
    for model in (aw.Task, aw.DesignSpace):
        assert json.dumps(" ".join((model.__doc__ or "").split()))[1:60] in " ".join(prompt.replace("\\n", " ").split())
    for objective in OBJECTIVES.values():
        assert f"- {objective.name} [{objective.unit}]: " in prompt
        assert objective.description in prompt
    for name in catalogue():
        assert f"- {name} (" in prompt
    assert task_template(Path("my-task.yaml")).strip() in prompt
    assert estimated_tokens(prompt) < 1.25 * MOST_TOKENS  # the whole schema of both files, asked once


def test_what_the_prompt_shows_as_finished_is_valid() -> None:
    found = read_documents(f"```yaml\n{SPACE_EXAMPLE}```\n```yaml\n{TASK}```")
    assert found.space == SPACE_EXAMPLE
    prompt = draft_prompt(WORDS)
    assert SPACE_EXAMPLE in prompt
    (shown,) = re.findall(r"A finished one:\n\n(name: shelf\n.*?)\n\n", prompt, re.DOTALL)
    assert aw.Task.model_validate(yaml.safe_load(shown)) == aw.load_task("shelf")
    space = aw.DesignSpace.model_validate(yaml.safe_load(SPACE_EXAMPLE))
    farthest = max(sum(c * c for c in point) ** 0.5 for point in aw.load_task("shelf").targets)
    assert space.max_reach / farthest == pytest.approx(1.4, abs=0.05)  # as its comment says


@pytest.mark.parametrize("text", ["`" * 100_000, "```\n" * 24_999, "- " * 50_000, "TASK\n" * 20_000, "{" * 100_000])
def test_odd_answers_are_refused(text: str) -> None:
    with pytest.raises(TaskError):
        read_documents(text)

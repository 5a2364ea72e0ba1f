"""Answers over the vendors' protocols: lenient about form, strict about values."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from armwright import Problem, StudyResult, load_task, optimize
from armwright.llm.transcript import Transcript
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, designer, wants_design
from tests.support.wire_formats import OUTPUTS, proposer

PROBLEM = Problem(load_task("target-1"))
GOOD = json.dumps(GOOD_DESIGN)
EXPECTED = {name: value for name, value in GOOD_DESIGN.items() if name != "reason"}
LEFT_OUT = {name: value for name, value in GOOD_DESIGN.items() if name != "link_4"}
UNKNOWN_JOINT = f"Here it is:\n{json.dumps({**GOOD_DESIGN, 'joint_1': 'Z'})}\nI hope this helps."

both_formats = pytest.mark.parametrize("wire", ["openai", "anthropic"])
every_output = pytest.mark.parametrize("output", OUTPUTS)


Ask = Callable[..., StudyResult]


@pytest.fixture
def ask(chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Ask:
    """One proposal."""

    def run(wire: str, **settings: Any) -> StudyResult:
        asked = proposer(wire, chat_server, monkeypatch, **settings)
        return optimize(PROBLEM, proposer=asked, n_init=4, n_step=3, n_total=1, out=tmp_path / "run", verify=False)

    return run


def giving(answer: Answer) -> Callable[[Request], Answer]:
    """The answer wherever a schema is asked for."""
    return lambda request: answer if wants_design(request) else designer(request)


@pytest.mark.parametrize(
    ("wire", "output", "text"),
    [
        ("openai", "tool", json.dumps({name: str(value) for name, value in GOOD_DESIGN.items()})),
        ("anthropic", "tool", json.dumps(EXPECTED)),
        ("openai", "native", f"```json\n{GOOD}\n```"),
        ("anthropic", "native", f"Here is the design:\n{GOOD}\nI hope this helps."),
        ("openai", "prompted", f'<think>Link 4 {{long}} or {{"link_4": 0.3}}?\nShort.</think>\n{GOOD}'),
    ],
    ids=["numbers as text", "no reason", "code fence", "words around", "thoughts before"],
)
def test_answers_are_read_in_any_form(chat_server: ChatServer, ask: Ask, wire: str, output: str, text: str) -> None:
    chat_server.answer = giving(text)
    run = ask(wire, output=output)
    assert (run.trials[4].source, dict(run.trials[4].design.params)) == ("llm", EXPECTED)
    assert len(chat_server.requests) == 3  # nothing is asked again


@pytest.mark.parametrize(
    ("wire", "output", "refused", "words"),
    [
        ("openai", "tool", json.dumps({**GOOD_DESIGN, "link_3": 1.4}), "link_3 = 1.4 m is outside 0.03 <="),
        ("anthropic", "tool", json.dumps(LEFT_OUT), "link_4"),
        ("openai", "native", UNKNOWN_JOINT, "joint_1 = 'Z' is not one of R, P, Y"),
        ("anthropic", "prompted", UNKNOWN_JOINT, "joint_1 = 'Z' is not one of R, P, Y"),
    ],
    ids=["out of range", "missing link", "native", "prompted"],
)
def test_refused_values_are_requested_again_with_the_reason(
    chat_server: ChatServer, ask: Ask, tmp_path: Path, wire: str, output: str, refused: str, words: str
) -> None:
    chat_server.answer = giving(refused)
    run = ask(wire, output=output)
    assert (run.trials[4].source, run.trials[4].fault) == ("bbo", "answer")
    assert len(chat_server.requests) == 2 + 3  # asked again twice
    again = chat_server.requests[-1]["messages"]
    assert words in json.dumps(again, ensure_ascii=False).replace("\\", "")
    failed = Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1]
    assert failed.error is not None
    assert words in failed.error
    assert failed.requests == 3
    assert "link_1" in failed.answer
    assert output == "tool" or failed.answer == refused  # with the text around it

"""Answers over the vendors' protocols: lenient about form, strict about values."""

import json
from collections.abc import Callable, Iterable, Sequence
from itertools import cycle, product
from pathlib import Path
from typing import Any

import pytest

from armwright.llm.transcript import Transcript
from armwright.problem.problem import Problem
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, designer, wants_design
from tests.support.wire_formats import OUTPUTS, proposer

PROBLEM = Problem(load_task("target-1"))
EXPECTED = {name: value for name, value in GOOD_DESIGN.items() if name != "reason"}
LEFT_OUT = {name: value for name, value in GOOD_DESIGN.items() if name != "link_4"}

# By hand rather than by json.dumps: what models write.
IN_ANY_FORM = {
    "plain": json.dumps(GOOD_DESIGN),
    "numbers as text": json.dumps({name: str(value) for name, value in GOOD_DESIGN.items()}),
    "whole numbers": json.dumps({**GOOD_DESIGN, "origin_x": 0}),
    "no reason": json.dumps(EXPECTED),
}
# Where the answer is text; a tool's arguments are JSON by the vendors' rules.
IN_TEXT = {
    "code fence": f"```json\n{json.dumps(GOOD_DESIGN)}\n```",
    "code fence without a name": f"```\n{json.dumps(GOOD_DESIGN)}\n```",
    "thoughts before": f'<think>Link 4 {{long}} or {{"link_4": 0.3}}?\nShort.</think>\n{json.dumps(GOOD_DESIGN)}',
    "words around": f"Here is the design:\n{json.dumps(GOOD_DESIGN)}\nI hope this helps.",
}
REFUSED = {
    "out of range": ({**GOOD_DESIGN, "link_3": 1.4}, "link_3 = 1.4 m is outside 0.03 <= link_3 <= 0.3 m"),
    "NaN": ({**GOOD_DESIGN, "link_3": "NaN"}, "link_3 = nan is not a finite number [m]"),
    "missing link": (LEFT_OUT, "link_4"),
    "unknown joint": ({**GOOD_DESIGN, "joint_1": "Z"}, "joint_1 = 'Z' is not one of R, P, Y"),
    "null": ({**GOOD_DESIGN, "origin_x": None}, "origin_x"),
}

both_formats = pytest.mark.parametrize("wire", ["openai", "anthropic"])
every_output = pytest.mark.parametrize("output", OUTPUTS)


def spread(cases: Iterable[str], outputs: Sequence[str] = OUTPUTS) -> pytest.MarkDecorator:
    """Run each case over one wire format and output in turn, and the first (slow) over every combination."""
    first, *others = cases
    ways = list(product(("openai", "anthropic"), outputs))
    everywhere = [pytest.param(*way, first, marks=pytest.mark.slow) for way in ways]
    in_turn = [(*way, case) for way, case in zip(cycle(ways), others, strict=False)]
    return pytest.mark.parametrize(("wire", "output", "case"), [*everywhere, *in_turn])


@pytest.fixture
def ask(chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., StudyResult]:
    """One proposal."""

    def run(wire: str, **settings: Any) -> StudyResult:
        asked = proposer(wire, chat_server, monkeypatch, **settings)
        return optimize(PROBLEM, proposer=asked, n_init=4, n_step=3, n_total=1, out=tmp_path / "run", verify=False)

    return run


def giving(answer: Answer) -> Callable[[Request], Answer]:
    """The answer wherever a schema is asked for."""
    return lambda request: answer if wants_design(request) else designer(request)


@spread(IN_ANY_FORM)
@pytest.mark.fast_cases(3)
def test_answers_are_read_in_any_form(
    chat_server: ChatServer, ask: Callable[..., StudyResult], wire: str, output: str, case: str
) -> None:
    chat_server.answer = giving(IN_ANY_FORM[case])
    run = ask(wire, output=output)
    assert (run.trials[4].source, dict(run.trials[4].design.params)) == ("llm", EXPECTED)
    assert len(chat_server.requests) == 3  # nothing is asked again


@spread(IN_TEXT, ("native", "prompted"))
def test_text_around_an_answer_is_ignored(
    chat_server: ChatServer, ask: Callable[..., StudyResult], wire: str, output: str, case: str
) -> None:
    chat_server.answer = giving(IN_TEXT[case])
    run = ask(wire, output=output)
    assert (run.trials[4].source, dict(run.trials[4].design.params)) == ("llm", EXPECTED)
    assert len(chat_server.requests) == 3


@every_output
@both_formats
@pytest.mark.fast_cases(3)
def test_one_step_answers_hold_reasoning_and_design(
    chat_server: ChatServer, ask: Callable[..., StudyResult], tmp_path: Path, wire: str, output: str
) -> None:
    chat_server.answer = giving(json.dumps({"reasoning": "Step 1: {think}.", **GOOD_DESIGN}))
    run = ask(wire, output=output, answer="one-step")
    assert (run.trials[4].reason, dict(run.trials[4].design.params)) == (GOOD_DESIGN["reason"], EXPECTED)
    assert len(chat_server.requests) == 2
    call = Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1]
    assert (call.step, json.loads(call.answer)["reasoning"]) == ("answer", "Step 1: {think}.")


@spread(REFUSED)
@pytest.mark.fast_cases(3)
def test_refused_values_are_requested_again_with_the_reason(
    chat_server: ChatServer, ask: Callable[..., StudyResult], tmp_path: Path, wire: str, output: str, case: str
) -> None:
    refused, words = REFUSED[case]
    chat_server.answer = giving(json.dumps(refused))
    run = ask(wire, output=output)
    assert (run.trials[4].source, run.trials[4].fault) == ("bbo", "answer")
    assert len(chat_server.requests) == 2 + 3  # asked again twice
    again = chat_server.requests[-1]["messages"]
    assert words in json.dumps(again, ensure_ascii=False).replace("\\", "")
    failed = Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1]
    assert failed.error is not None
    assert words in failed.error
    assert failed.requests == 3


@pytest.mark.parametrize("output", ["native", "prompted"])
@both_formats
def test_refused_answers_are_recorded_with_the_text_around_them(
    chat_server: ChatServer, ask: Callable[..., StudyResult], tmp_path: Path, wire: str, output: str
) -> None:
    written = f"Here it is:\n{json.dumps({**GOOD_DESIGN, 'joint_1': 'Z'})}\nI hope this helps."
    chat_server.answer = giving(written)
    ask(wire, output=output)
    failed = Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1]
    assert (failed.fault, failed.answer) == ("answer", written)


@every_output
@both_formats
@pytest.mark.fast_cases(3)
def test_corrected_answers_are_accepted(
    chat_server: ChatServer, ask: Callable[..., StudyResult], wire: str, output: str
) -> None:
    answers = iter([REFUSED["missing link"][0], REFUSED["NaN"][0], GOOD_DESIGN])
    chat_server.answer = lambda request: json.dumps(next(answers)) if wants_design(request) else designer(request)
    assert dict(ask(wire, output=output).trials[4].design.params) == EXPECTED

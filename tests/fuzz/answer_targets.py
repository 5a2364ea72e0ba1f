"""Fuzz answers of models and people, as designs and as drafts."""

import json
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

import yaml

import armwright as aw
from armwright.problem.problem import Problem
from tests import ROOT
from tests.fuzz.problem_targets import MAX_POSTURES, RICH_SPACE, RICH_TASK, a_problem, n_postures, rich_problem
from tests.fuzz.target import DefectError, any_of, folder


def answer_seeds() -> list[bytes]:
    plain, rich = a_problem(), rich_problem()
    found: list[str] = []
    for problem in (plain, rich):
        designs = [dict(design.params) for design in problem.space.sample(3, 2)]
        found += [json.dumps(design) for design in designs]
        found.append(json.dumps({"reasoning": "so", **designs[0], "reason": "why"}))
        found.append(f"I think so.\n```json\n{json.dumps(designs[0], indent=2)}\n```\nThat is it.")
    found.append("<think>hm</think>\nORIGIN: (0.1, -0.2, 0.0)\nJOINTS: Y, P, R, P\nLINKS: 0.1 0.2 0.3 0.1\nREASON: x")
    found.append("**ORIGIN** = [0, 0, 0]\n- JOINTS = YPRP\n1. LINKS = 0.1 m, 0.1 m, .2 m, 0.25 m")
    found.append('{"origin": [0, 0.1, 0], "joints": "YPRP", "links": ["0.1 m", 0.2, "0.3", 0.1]}')
    return [text.encode() for text in found]


def run_answer(data: bytes) -> None:
    from armwright.llm.answer import last_json_object, read_answer, read_text, written_answer

    text = data.decode("utf-8", "surrogateescape")
    last_json_object(text)
    found: list[Callable[[], object]] = []
    for problem in (a_problem(), rich_problem()):

        def read(problem: Problem = problem) -> None:
            answer = read_text(text, problem)
            if read_text(written_answer(answer), problem) != answer:
                raise DefectError(f"an answer that is read back as another: {answer}")

        found.append(read)
        with suppress(ValueError, RecursionError):
            content = json.loads(text)
            if isinstance(content, dict):
                found.append(lambda problem=problem, content=content: read_answer(content, problem))
    any_of(found)


def draft_seeds() -> list[bytes]:
    rich = {"task": yaml.safe_load(RICH_TASK), "space": yaml.safe_load(RICH_SPACE)}
    examples = {name: ROOT / "examples" / f"2-assembly-{name}.yaml" for name in ("task", "space")}
    plain = {name: yaml.safe_load(file.read_text(encoding="utf-8")) for name, file in examples.items()}
    small = {"name": "drafted", "targets": [[0.4, 0, 0.1], [0.4, 0.2, 0.1]], "provenance": "made up"}
    answers = [
        {**rich, "assumptions": ["one", "two"], "questions": ["three"]},
        {"reasoning": "so", **plain},
        {"task": small, "space": None, "assumptions": "all"},
        {"task": small},
    ]
    return [json.dumps(answer).encode() for answer in answers]


class _Answered:
    """A model that gives one answer."""

    model, origin, text = "stand-in", "scripted", ""

    def begin(self) -> None: ...

    def cancel(self) -> None: ...

    def ask(self, question: Any, output: Any = None, most_requests: Any = None, earlier: Any = None) -> Any:
        from armwright.llm.backend import CallError, Reply

        try:
            content = json.loads(self.text)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            raise CallError("answer", "no object", Reply(self.text, requests=1))
        return Reply(output.read(content), requests=1)


@cache
def drafter(written: bool) -> tuple[Any, _Answered]:
    from armwright.llm.configuration import ConfiguredModel
    from armwright.llm.draft import Drafter

    options = aw.ModelOptions(model="openai-chat:stand-in", base_url="http://127.0.0.1:9/v1", origin="scripted")
    made = Drafter(ConfiguredModel(options, "--model"), folder() / "drafts" / "in" if written else None, force=True)
    answers = _Answered()
    made.backend = answers  # type: ignore[assignment]
    return made, answers


def run_draft(data: bytes) -> None:
    from armwright.llm.transcript import Transcript

    text = data.decode("utf-8", "replace")
    is_written = len(data) % 8 == 0
    made, answers = drafter(is_written)
    made._transcript = Transcript(None)
    answers.text = text
    try:
        draft = made.draft("put it down there")
    finally:
        if is_written:
            outside = [path for path in (folder() / "drafts").iterdir() if path.name != "in"]
            inside = sorted((folder() / "drafts" / "in").iterdir())
            for path in inside:
                path.unlink()
            if outside or len(inside) > 2:
                raise DefectError(f"written elsewhere: {outside} {inside}")
    if n_postures(draft.problem) <= MAX_POSTURES:
        draft.problem.evaluate(draft.problem.space.sample(1, 0))
    json.dumps(draft.record(), allow_nan=False)

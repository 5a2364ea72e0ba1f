"""Fuzz answers of models and people."""

import json
from collections.abc import Callable
from contextlib import suppress

from armwright.problem.problem import Problem
from tests.fuzz.problem_targets import a_problem, rich_problem
from tests.fuzz.target import DefectError, any_of


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

"""A model's answer turned into designs: the schema it is asked for, and what is taken of what it gives.

Lenient in form (numbers as text, lower-case joint letters, code fences, thoughts before the answer), strict in
substance: the design space refuses in its own words.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

from armwright.exceptions import DesignError
from armwright.problem import Problem
from armwright.space import CategoricalParameter, Design, DesignSpace, Parameter, ParameterValue

LONGEST_ANSWER = 100_000  # characters; the end counts
MOST_OBJECTS = 1000  # braces tried in a free answer
LONGEST_REASON = 300


@dataclass(frozen=True)
class Answer:
    """A design, why it was chosen, and the objectives that were expected of it (where that was asked)."""

    design: Design
    reason: str = ""
    expected: tuple[float, ...] | None = None


def answer_schema(problem: Problem, *, reasoning: bool, expected: bool, proposals: int) -> dict[str, Any]:
    """JSON schema of an answer: one property a parameter, and the reason; of several designs, a list of such.

    reasoning: whether the thoughts come first, in the same answer.
    expected: whether the objectives that the design is expected to have are asked for.

    Ranges are told, not enforced here: the design space refuses in its own words.
    """
    fields: dict[str, Any] = {parameter.name: _property(parameter) for parameter in problem.space.parameters}
    if expected:
        for objective in problem.objectives:
            words = f"the {objective.symbol} that you expect of this design, in all [{objective.unit}]"
            fields[f"expected_{objective.name}"] = {"type": "number", "description": words}
    fields["reason"] = {"type": "string", "description": "the main reason for this design, in one sentence"}
    content = {"designs": {"type": "array", "items": _object(fields)}} if proposals > 1 else fields
    if reasoning:
        content = {"reasoning": {"type": "string", "description": "your analysis, step by step"}, **content}
    title = "NewDesign" if proposals == 1 else "NewDesigns"
    return {"title": title, "description": "What to evaluate next.", **_object(content)}


def read_answers(content: Mapping[str, Any], problem: Problem, proposals: int = 1) -> list[Answer]:
    """The designs of an answer, at most `proposals`; DesignError, in the words of the design space, refuses it."""
    content = {key: value for key, value in content.items() if key != "reasoning"}
    if "designs" not in content:
        return [_read(content, problem)]
    designs: Any = content["designs"]
    if not isinstance(designs, list) or not designs:
        raise DesignError("designs holds no design: a list of objects, one a design, is needed")
    answers: list[Answer] = []
    for number, design in enumerate(cast("list[Any]", designs)[:proposals], start=1):
        if not isinstance(design, dict):
            raise DesignError(f"design {number} is not an object with one value a parameter")
        try:
            answers.append(_read(cast("dict[str, Any]", design), problem))
        except DesignError as refusal:
            raise DesignError(f"design {number}: {refusal}") from refusal
    return answers


def written_answers(answers: Sequence[Answer], problem: Problem, reasoning: str = "") -> str:
    """Answers as JSON that `read_answers` reads back to the same."""
    designs = [_content(answer, problem) for answer in answers]
    content: dict[str, Any] = {"reasoning": reasoning} if reasoning else {}
    content.update(designs[0] if len(designs) == 1 else {"designs": designs})
    return json.dumps(content, ensure_ascii=False)


def read_text(text: str, problem: Problem, proposals: int = 1) -> list[Answer]:
    """The designs of an answer in free text: its last JSON object, else its last ORIGIN, JOINTS and LINKS lines."""
    text = re.sub(r"<think>.*?</think>", "", text[-LONGEST_ANSWER:], flags=re.DOTALL)
    names = {parameter.name for parameter in problem.space.parameters}
    for content, _ in _objects(text):
        if names & content.keys() or "designs" in content:
            return read_answers(content, problem, proposals)
    answers = [_read(lines, problem) for lines in _named_lines(text, problem.space)[-proposals:]]
    if not answers:
        raise DesignError(
            "no design found: give JSON with one value a parameter, or the lines ORIGIN, JOINTS and LINKS"
        )
    return answers


def without_words_around(text: str) -> str:
    """The last JSON object of a text, as it is written there; the text itself where it holds none."""
    return next((written for _, written in _objects(text[-LONGEST_ANSWER:])), text)


def _property(parameter: Parameter) -> dict[str, Any]:
    if isinstance(parameter, CategoricalParameter):
        return {"type": "string", "enum": list(parameter.choices)}
    words = f"{parameter.low:g} <= {parameter.name} <= {parameter.high:g} {parameter.unit}"
    return {"type": "number", "description": words}


def _object(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": dict(fields), "required": list(fields), "additionalProperties": False}


def _read(content: Mapping[str, Any], problem: Problem) -> Answer:
    content = dict(content)
    reason = " ".join(str(content.pop("reason", "")).split())[:LONGEST_REASON]
    expected = [_number(content.pop(f"expected_{objective.name}", None)) for objective in problem.objectives]
    kinds = {parameter.name: parameter for parameter in problem.space.parameters}
    params = {name: _value(kinds.get(name), value) for name, value in content.items()}
    design = problem.space.design(params)
    known = [value for value in expected if isinstance(value, float) and math.isfinite(value)]
    return Answer(design, reason, tuple(known) if len(known) == len(expected) else None)


def _value(parameter: Parameter | None, value: Any) -> Any:
    """The value as the design space wants it, where only its form differs."""
    if isinstance(parameter, CategoricalParameter):
        word = str(value).strip().strip("'\"").lower()
        return next((choice for choice in parameter.choices if choice.lower() == word), value)
    return _number(value, "" if parameter is None else parameter.unit)


def _number(value: Any, unit: str = "") -> Any:
    """A number that was written as text (`"0.25"`, `"0.25 m"`), else the value itself."""
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value) if abs(value) < 2**63 else value
    if isinstance(value, str):
        try:
            return float(value.strip().removesuffix(unit).strip())
        except ValueError:
            return value
    return value


def _content(answer: Answer, problem: Problem) -> dict[str, Any]:
    content: dict[str, Any] = dict(answer.design.params)
    for objective, value in zip(problem.objectives, answer.expected or (), strict=False):
        content[f"expected_{objective.name}"] = value
    return {**content, "reason": answer.reason}


def _objects(text: str) -> Iterator[tuple[dict[str, Any], str]]:
    """The outermost JSON objects of a text with what is written there, the last first."""
    found: list[tuple[dict[str, Any], str]] = []
    decoder, place = json.JSONDecoder(), text.find("{")
    for _ in range(MOST_OBJECTS):
        if place < 0:
            break
        try:
            content, end = decoder.raw_decode(text, place)
            found.append((content, text[place:end]))
        except (ValueError, RecursionError):
            end = place + 1
        place = text.find("{", end)
    return reversed(found)


_LINE = re.compile(r"^[\s>*_#`-]*(ORIGIN|JOINTS|LINKS|REASON)[\s*_`]*[:=](.*)$", re.IGNORECASE | re.MULTILINE)


def _named_lines(text: str, space: DesignSpace) -> list[dict[str, ParameterValue]]:
    """The parameters of each group of ORIGIN, JOINTS and LINKS lines, in the order of the text."""
    groups: list[dict[str, Any]] = []
    for match in _LINE.finditer(text):
        name, rest = match[1].lower(), match[2]
        if name == "origin":
            groups.append({})
        if not groups:
            continue
        if name == "reason":
            groups[-1]["reason"] = rest.strip()
        elif name == "joints":
            types = re.findall(r"[A-Za-z]+", rest)
            letters = list(types[0]) if len(types) == 1 else types  # YPRP as one word, too
            groups[-1].update({f"joint_{j}": kind for j, kind in enumerate(letters, start=1)})
        else:
            numbers = re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf", rest, re.IGNORECASE)
            names = ("origin_x", "origin_y", "origin_z") if name == "origin" else None
            for j, number in enumerate(numbers):
                key = f"link_{j + 1}" if names is None else names[j] if j < 3 else f"origin_{j + 1}"
                groups[-1][key] = float(number)
    return groups

"""A model's answer turned into designs: the schema it is asked for, and what is taken of what it gives.

Lenient in form (numbers as text, lower-case joint letters, code fences, thoughts before the answer), strict in
substance: nothing is guessed, and the design space refuses in its own words.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, cast

from armwright.exceptions import DesignError
from armwright.llm.answer_format import designs_in_lines, plain_number, words_of_lists
from armwright.problem.problem import Problem
from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS
from armwright.spaces.parameters import CategoricalParameter, Design, Parameter, exact
from armwright.text import one_line, without_thoughts

LONGEST_ANSWER = 100_000  # characters; the end counts
MOST_OBJECTS = 1000  # braces tried in a free answer, from its end
LONGEST_REASON = 300  # characters
LONGEST_VALUE = 60  # characters of a value or a name that a refusal repeats


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
            words = f"the {objective.symbol} that you expect of this design, summed over all targets [{objective.unit}]"
            fields[f"expected_{objective.name}"] = {"type": "number", "description": words}
    fields["reason"] = {"type": "string", "description": "the main reason for this design, in one sentence"}
    if proposals > 1:
        words = f"{proposals} designs, each different from the others"
        content = {"designs": {"type": "array", "description": words, "items": object_schema(fields)}}
    else:
        content = fields
    return response_schema("NewDesign" if proposals == 1 else "NewDesigns", content, reasoning=reasoning)


def read_answers(content: Mapping[str, Any], problem: Problem, proposals: int = 1) -> list[Answer]:
    """The designs of an answer, the first `proposals` if there are more.

    DesignError, in the words of the design space, refuses it.
    """
    content = {key: value for key, value in content.items() if key != "reasoning"}
    if "designs" not in content:
        return [_read(content, problem)]
    designs: Any = content["designs"]
    if not isinstance(designs, list) or not designs:
        raise DesignError("designs holds no design: a list of objects, one a design, is needed")
    return _read_all(cast("list[Any]", designs)[:proposals], problem)


def written_answers(answers: Sequence[Answer], problem: Problem, reasoning: str = "") -> str:
    """Answers as JSON that `read_text` reads back to the same."""
    designs = [_content(answer, problem) for answer in answers]
    return answer_json(designs[0] if len(designs) == 1 else {"designs": designs}, reasoning)


def answer_json(content: Mapping[str, Any], reasoning: str) -> str:
    """Return an answer as JSON, with the reasoning first if there is any."""
    return json.dumps({**({"reasoning": reasoning} if reasoning else {}), **content}, ensure_ascii=False)


def read_text(text: str, problem: Problem, proposals: int = 1) -> list[Answer]:
    """The designs of an answer in free text: what comes last, of JSON objects and of ORIGIN, JOINTS and LINKS lines.

    Of several designs one after the other, the last `proposals`. A JSON object that does not end is refused: what
    stands before it was not the answer.
    """
    with suppress(ValueError, RecursionError):  # JSON and nothing else, such as an answer that was kept
        content = _decoder.decode(text.strip())
        if isinstance(content, dict):
            return read_answers(cast("dict[str, Any]", content), problem, proposals)
    text = without_thoughts(text)[-LONGEST_ANSWER:]
    names = {"designs", "origin", "joints", "links", *(parameter.name for parameter in problem.space.parameters)}
    found, broken = _objects(text, names)
    place, lines = designs_in_lines(text)
    if broken > max(place, found[-1][0] if found else -1):
        raise DesignError("the last JSON object is not whole: give one value a parameter, and close its braces")
    if lines and (not found or place > found[-1][0]):
        return _read_all(lines[-proposals:], problem)
    if not found:
        raise DesignError(
            "no design found: give JSON with one value a parameter, or the lines ORIGIN, JOINTS and LINKS"
        )
    last = found[-1][1]
    if "designs" in last:
        return read_answers(last, problem, proposals)
    return _read_all([content for _, content in found if "designs" not in content][-proposals:], problem)


def without_words_around(text: str) -> str:
    """The last JSON object of a text, as it is written there; the text itself where it holds none."""
    text = text[-LONGEST_ANSWER:]
    found, end = text, 0
    for brace in islice(re.finditer(r"\{", text), MOST_OBJECTS):
        if brace.start() >= end:
            with suppress(ValueError, RecursionError):
                _, end = _decoder.raw_decode(text, brace.start())
                found = text[brace.start() : end]
    return found


def _property(parameter: Parameter) -> dict[str, Any]:
    if isinstance(parameter, CategoricalParameter):
        return {"type": "string", "enum": list(parameter.choices)}
    words = f"{exact(parameter.low)} <= {parameter.name} <= {exact(parameter.high)} {parameter.unit}"
    if parameter.step > 0.0:
        words += f", in steps of {exact(parameter.step)}"
    return {"type": "number", "description": words}


def response_schema(title: str, fields: Mapping[str, Any], *, reasoning: bool) -> dict[str, Any]:
    """Return the JSON schema of a whole answer, with the model's analysis first if `reasoning` is set."""
    if reasoning:
        fields = {"reasoning": {"type": "string", "description": "your analysis, step by step"}, **fields}
    return {"title": title, "description": "What to evaluate next.", **object_schema(fields)}


def object_schema(fields: Mapping[str, Any], required: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the JSON schema of an object with these properties and no others; all are required by default."""
    needed = list(fields if required is None else required)
    return {"type": "object", "properties": dict(fields), "required": needed, "additionalProperties": False}


def _read_all(designs: Sequence[Any], problem: Problem) -> list[Answer]:
    """Each design; of several, a refusal says which."""
    answers: list[Answer] = []
    for number, design in enumerate(designs, start=1):
        try:
            if not isinstance(design, Mapping):
                raise DesignError("not an object with one value a parameter")
            answers.append(_read(cast("Mapping[str, Any]", design), problem))
        except DesignError as refusal:
            if len(designs) == 1:
                raise
            raise DesignError(f"design {number}: {refusal}") from refusal
    return answers


def _read(content: Mapping[str, Any], problem: Problem) -> Answer:
    content = words_of_lists({one_line(str(key), LONGEST_VALUE).lower(): value for key, value in content.items()})
    reason = one_line(_as_text(content.pop("reason", None) or ""), LONGEST_REASON)
    names = [f"expected_{objective.name}" for objective in problem.objectives]
    together: Any = content.pop("expected", None)
    if isinstance(together, (list, tuple)) and len(cast("list[Any]", together)) == len(names):
        content |= dict(zip(names, cast("list[Any]", together), strict=True))
    expected = [_number(content.pop(name, None)) for name in names]
    kinds = {parameter.name: parameter for parameter in problem.space.parameters}
    params = {name: _value(kinds.get(name), value) for name, value in content.items()}
    n_joints = kinds.get("n_joints")
    if n_joints is not None and "n_joints" not in params:  # lists say it by their length
        params["n_joints"] = str(sum(name.startswith("joint_") for name in params))
    design = problem.space.design(params)
    known = [value for value in expected if isinstance(value, float) and math.isfinite(value)]
    return Answer(design, reason, tuple(known) if len(known) == len(expected) else None)


def _value(parameter: Parameter | None, value: Any) -> Any:
    """The value as the design space wants it, where only its form differs."""
    if isinstance(parameter, CategoricalParameter):
        counted = isinstance(value, int) and not isinstance(value, bool)
        word = str(value).strip().strip("'\"").lower() if counted or isinstance(value, str) else None
        spoken = {kind: words.partition(",")[0] for kind, words in JOINT_DESCRIPTIONS.items()}
        for choice in parameter.choices:
            if word in (choice.lower(), spoken.get(choice)):  # pyright: ignore[reportArgumentType, reportCallIssue]
                return choice
        return _short(value)
    return _number(value, "" if parameter is None else parameter.unit)


def _number(value: Any, unit: str = "") -> Any:
    """A number that was written as text (`"0.25"`, `"0.25 m"`), else the value itself."""
    if isinstance(value, int) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            return math.inf if value > 0 else -math.inf
    if isinstance(value, str):
        number = plain_number(value, unit)
        return _short(value) if number is None else number
    return _short(value)


def _short(value: Any) -> Any:
    """A value that will be refused, so that the refusal is one line."""
    words = _as_text(value)
    short = one_line(words, LONGEST_VALUE)
    return value if short == words else short


def _as_text(value: Any) -> str:
    try:
        return value if isinstance(value, str) else repr(value)
    except RecursionError:
        return "a list in a list in a list, and so on"


def _content(answer: Answer, problem: Problem) -> dict[str, Any]:
    content: dict[str, Any] = dict(answer.design.params)
    for objective, value in zip(problem.objectives, answer.expected or (), strict=False):
        content[f"expected_{objective.name}"] = value
    return {**content, "reason": answer.reason}


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; a name that stands there twice with two values is refused later, as neither of them."""
    content: dict[str, Any] = {}
    for name, value in pairs:
        if name in content and content[name] != value:
            value = f"{content[name]} and {value}"
        content[name] = value
    return content


_decoder = json.JSONDecoder(object_pairs_hook=_once)


def _objects(text: str, names: set[str]) -> tuple[list[tuple[int, dict[str, Any]]], int]:
    """The outermost JSON objects that hold one of `names`, with their places; and the place of a broken one, or -1."""
    # Commas too many and comments are common; blanks keep the places.
    text = re.sub(r'//[^"\n]*$', lambda comment: " " * len(comment[0]), text, flags=re.MULTILINE)
    text = re.sub(r",(?=\s*[}\]])", " ", text)
    braces = [match.start() for match in re.finditer(r'\{\s*"', text)][-MOST_OBJECTS:]
    found: list[tuple[int, dict[str, Any]]] = []
    end, broken = 0, -1
    for place in braces:
        if place < end:
            continue
        try:
            content, end = _decoder.raw_decode(text, place)
        except (ValueError, RecursionError):
            start = text[place : place + 200].lower()
            if any(f'"{name}"' in start for name in names):
                broken = place
            continue
        if names & {str(name).lower() for name in content}:
            found.append((place, content))
    return found, broken

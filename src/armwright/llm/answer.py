"""A model's answer: its JSON schema, and the designs read from it.

Reading is lenient about form (numbers as text, lower-case joint letters, code fences, thoughts before the answer) and
strict about content: nothing is guessed, and errors are those of the design space.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, cast

from armwright.arrays import LARGEST_OBJECTIVE
from armwright.exceptions import DesignError
from armwright.llm.answer_format import JOINT_NAMES, designs_in_lines, expand_lists, plain_number
from armwright.llm.model_options import PromptOptions
from armwright.problem.problem import Problem
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter, Design, Parameter, exact
from armwright.text import one_line, without_thoughts

MAX_ANSWER_LENGTH = 100_000  # characters that are read, from the end
MAX_OBJECTS = 1000  # braces tried as JSON, from the end of a free answer
MAX_REASON_LENGTH = 300  # characters
MAX_VALUE_LENGTH = 60  # characters of a value or a name in an error


@dataclass(frozen=True)
class Answer:
    """A design, the reason for it, and the expected objectives if they were asked for."""

    design: Design
    reason: str = ""
    expected: tuple[float, ...] | None = None


def answer_schema(problem: Problem, options: PromptOptions) -> dict[str, Any]:
    """Return the JSON schema of an answer: one property per parameter and the reason, or a list of such designs.

    Ranges are described but not enforced: the design space can say what is wrong.

    Args:
        problem: gives the parameters and the objectives.
        options: form of the answer, number of designs, and whether objectives are expected.
    """
    fields: dict[str, Any] = {parameter.name: _property(parameter) for parameter in problem.space.parameters}
    if options.expects:
        for objective in problem.objectives:
            unit = objective.unit_in_brackets
            text = f"the {objective.symbol} that you expect of this design, summed over all targets{unit}"
            fields[f"expected_{objective.name}"] = {"type": "number", "description": text}
    fields["reason"] = {"type": "string", "description": "the main reason for this design, in one sentence"}
    if options.proposals > 1:
        text = f"{options.proposals} designs, each different from the others"
        content = {"designs": {"type": "array", "description": text, "items": object_schema(fields)}}
    else:
        content = fields
    return response_schema("NewDesign" if options.proposals == 1 else "NewDesigns", content, options)


def read_answers(content: Mapping[str, Any], problem: Problem, proposals: int = 1) -> list[Answer]:
    """Return the designs of an answer, at most `proposals`.

    Raises:
        DesignError: A design is invalid.
    """
    designs: Any = content.get("designs", [{key: value for key, value in content.items() if key != "reasoning"}])
    if not isinstance(designs, list) or not designs:
        raise DesignError("designs: expected a list of objects, one per design")
    return _read_all(cast("list[Any]", designs)[:proposals], problem)


def written_answers(answers: Sequence[Answer], problem: Problem, reasoning: str = "") -> str:
    """Return answers as JSON, which `read_text` reads without loss."""
    designs = [_content(answer, problem) for answer in answers]
    return answer_json(designs[0] if len(designs) == 1 else {"designs": designs}, reasoning)


def answer_json(content: Mapping[str, Any], reasoning: str) -> str:
    """Return an answer as JSON, with the reasoning first if there is any."""
    return json.dumps({**({"reasoning": reasoning} if reasoning else {}), **content}, ensure_ascii=False)


def read_text(text: str, problem: Problem, proposals: int = 1) -> list[Answer]:
    """Return the last `proposals` designs of a free answer, from JSON objects or ORIGIN, JOINTS and LINKS lines.

    Raises:
        DesignError: There is no valid design, or the last JSON object is incomplete; earlier ones were not the answer.
    """
    with suppress(ValueError, RecursionError):  # JSON only, such as a recorded answer
        content = _decoder.decode(text.strip())
        if isinstance(content, dict):
            return read_answers(cast("dict[str, Any]", content), problem, proposals)
    text = without_thoughts(text)[-MAX_ANSWER_LENGTH:]
    names = {"designs", "origin", "joints", "links", *(parameter.name for parameter in problem.space.parameters)}
    objects, incomplete = _objects(text, names)
    last_object = objects[-1][0] if objects else -1
    last_line, lines = designs_in_lines(text, per_joint(problem.space))
    if incomplete > max(last_line, last_object):
        raise DesignError("the last JSON object is incomplete: give one value per parameter, and close its braces")
    if last_line > last_object:
        return _read_all(lines[-proposals:], problem)
    if not objects:
        raise DesignError(
            "no design found: give JSON with one value per parameter, or the lines ORIGIN, JOINTS and LINKS"
        )
    last = objects[-1][1]
    if "designs" in last:
        return read_answers(last, problem, proposals)
    return _read_all([content for _, content in objects if "designs" not in content][-proposals:], problem)


def last_json_object(text: str) -> str:
    """Return the last JSON object of a text as it is written there, or the text if it holds none."""
    text = text[-MAX_ANSWER_LENGTH:]
    last, end = text, 0
    for brace in islice(re.finditer(r"\{", text), MAX_OBJECTS):
        if brace.start() >= end:
            with suppress(ValueError, RecursionError):
                _, end = _decoder.raw_decode(text, brace.start())
                last = text[brace.start() : end]
    return last


def per_joint(space: DesignSpace) -> dict[str, bool]:
    """Return the names of the custom parameters, and whether each has a value per joint."""
    return {name: custom.per is not None for name, custom in space.custom}


def _property(parameter: Parameter) -> dict[str, Any]:
    if isinstance(parameter, CategoricalParameter):
        return {"type": "string", "enum": list(parameter.choices)}
    description = f"{exact(parameter.low)} <= {parameter.name} <= {exact(parameter.high)} {parameter.unit}".rstrip()
    if parameter.step > 0.0 and not (parameter.integer and parameter.step == 1.0):
        description += f", in steps of {exact(parameter.step)}"
    return {"type": "integer" if parameter.integer else "number", "description": description}


def response_schema(title: str, fields: Mapping[str, Any], options: PromptOptions) -> dict[str, Any]:
    """Return the JSON schema of a whole answer, with the model's analysis first if there is no call before it."""
    if options.form == "schema":
        fields = {"reasoning": {"type": "string", "description": "your analysis, step by step"}, **fields}
    return {"title": title, "description": "What to evaluate next.", **object_schema(fields)}


def object_schema(fields: Mapping[str, Any], required: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the JSON schema of an object with these properties and no others; all are required by default."""
    needed = list(fields if required is None else required)
    return {"type": "object", "properties": dict(fields), "required": needed, "additionalProperties": False}


def _read_all(designs: Sequence[Any], problem: Problem) -> list[Answer]:
    """Read each design; if there are several, errors name the design."""
    answers: list[Answer] = []
    for number, design in enumerate(designs, start=1):
        try:
            if not isinstance(design, Mapping):
                raise DesignError("expected an object with one value per parameter")
            answers.append(_read(cast("Mapping[str, Any]", design), problem))
        except DesignError as error:
            if len(designs) == 1:
                raise
            raise DesignError(f"design {number}: {error}") from error
    return answers


def _read(content: Mapping[str, Any], problem: Problem) -> Answer:
    lower = {one_line(str(key), MAX_VALUE_LENGTH).lower(): value for key, value in content.items()}
    content = expand_lists(lower, per_joint(problem.space))
    reason = one_line(_as_text(content.pop("reason", None) or ""), MAX_REASON_LENGTH)
    names = [f"expected_{objective.name}" for objective in problem.objectives]
    values: Any = content.pop("expected", None)  # a list in place of the single values
    if isinstance(values, (list, tuple)) and len(cast("list[Any]", values)) == len(names):
        content |= dict(zip(names, cast("list[Any]", values), strict=True))
    expected = [_number(content.pop(name, None)) for name in names]
    kinds = {parameter.name: parameter for parameter in problem.space.parameters}
    params = {name: _value(kinds.get(name), value) for name, value in content.items()}
    n_joints = kinds.get("n_joints")
    if n_joints is not None and "n_joints" not in params:  # given by the length of a list
        params["n_joints"] = str(sum(name.startswith("joint_") for name in params))
    design = problem.space.design(params)
    known = [value for value in expected if isinstance(value, float) and abs(value) <= LARGEST_OBJECTIVE]
    return Answer(design, reason, tuple(known) if len(known) == len(expected) else None)


def _value(parameter: Parameter | None, value: Any) -> Any:
    """Return the value in the form that the design space expects, or the value itself."""
    if isinstance(parameter, CategoricalParameter):
        is_text = isinstance(value, (str, int)) and not isinstance(value, bool)
        text = str(value).strip().strip("'\"").lower() if is_text else ""
        for choice in parameter.choices:
            if text == choice.lower() or JOINT_NAMES.get(text) == choice:
                return choice
        return _short(value)
    return _number(value, "" if parameter is None else parameter.unit)


def _number(value: Any, unit: str = "") -> Any:
    """Return the number of a text (`"0.25"`, `"0.25 m"`), or the value itself."""
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
    """Shorten a value that will be refused, so that the error fits on one line."""
    text = _as_text(value)
    short = one_line(text, MAX_VALUE_LENGTH)
    return value if short == text else short


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


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object. A repeated name gets a value that the design space refuses."""
    content: dict[str, Any] = {}
    for name, value in pairs:
        if name in content and content[name] != value:
            value = f"{content[name]} and {value}"
        content[name] = value
    return content


_decoder = json.JSONDecoder(object_pairs_hook=_without_repeats)


def _objects(text: str, names: set[str]) -> tuple[list[tuple[int, dict[str, Any]]], int]:
    """Return the outermost JSON objects that have one of `names`, and the position of an incomplete one or -1."""
    # Trailing commas and comments are common; blanks in their place keep the positions.
    text = "\n".join(map(_without_comment, text.split("\n")))
    text = re.sub(r",(?=\s*[}\]])", " ", text)
    braces = [match.start() for match in re.finditer(r'\{\s*"', text)][-MAX_OBJECTS:]
    objects: list[tuple[int, dict[str, Any]]] = []
    end, incomplete = 0, -1
    for position in braces:
        if position < end:
            continue
        try:
            content, end = _decoder.raw_decode(text, position)
        except (ValueError, RecursionError):
            beginning = text[position : position + 200].lower()
            if any(f'"{name}"' in beginning for name in names):
                incomplete = position
            continue
        if names & {str(name).lower() for name in content}:
            objects.append((position, content))
    return objects, incomplete


def _without_comment(line: str) -> str:
    """Replace a comment after the last quotation mark of a line by blanks."""
    start = line.find("//", line.rfind('"') + 1)
    return line if start < 0 else line[:start] + " " * (len(line) - start)

"""A model's answer: its JSON schema, and the design read from it.

Reading is lenient about form (numbers as text, lower-case joint letters, code fences, thoughts before the answer) and
strict about content: nothing is guessed, and errors are those of the design space.
"""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, cast

from armwright.exceptions import DesignError
from armwright.llm.answer_format import JOINT_NAMES, design_in_lines, expand_lists, plain_number
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
    """A design and the reason for it."""

    design: Design
    reason: str = ""


def answer_schema(problem: Problem, options: PromptOptions) -> dict[str, Any]:
    """Return the JSON schema of an answer: one property per parameter, and the reason.

    Ranges are described but not enforced: the design space can say what is wrong.
    """
    fields: dict[str, Any] = {parameter.name: _property(parameter) for parameter in problem.space.parameters}
    return response_schema("NewDesign", fields, "this design", options)


def read_answer(content: Mapping[str, Any], problem: Problem) -> Answer:
    """Return the design of an answer; raises DesignError if it is invalid."""
    lower = {one_line(str(key), MAX_VALUE_LENGTH).lower(): value for key, value in content.items()}
    lower.pop("reasoning", None)
    content = expand_lists(lower, per_joint(problem.space))
    reason = short_reason(content.pop("reason", None))
    kinds = {parameter.name: parameter for parameter in problem.space.parameters}
    params = {name: _value(kinds.get(name), value) for name, value in content.items()}
    n_joints = kinds.get("n_joints")
    if n_joints is not None and "n_joints" not in params:  # given by the length of a list
        params["n_joints"] = str(sum(name.startswith("joint_") for name in params))
    return Answer(problem.space.design(params), reason)


def written_answer(answer: Answer, reasoning: str = "") -> str:
    """Return an answer as JSON, which `read_text` reads without loss."""
    return answer_json({**answer.design.params, "reason": answer.reason}, reasoning)


def answer_json(content: Mapping[str, Any], reasoning: str) -> str:
    """Return an answer as JSON, with the reasoning first if there is any."""
    return json.dumps({**({"reasoning": reasoning} if reasoning else {}), **content}, ensure_ascii=False)


def short_reason(reason: Any) -> str:
    """Return the reason of an answer on one line."""
    return one_line(_as_text(reason or ""), MAX_REASON_LENGTH)


def read_text(text: str, problem: Problem) -> Answer:
    """Return the last design of a free answer, from a JSON object or from ORIGIN, JOINTS and LINKS lines.

    Raises:
        DesignError: There is no valid design, or the last JSON object is incomplete; earlier ones were not the answer.
    """
    with suppress(ValueError, RecursionError):  # JSON only, such as a recorded answer
        content = _decoder.decode(text.strip())
        if isinstance(content, dict):
            return read_answer(cast("dict[str, Any]", content), problem)
    text = without_thoughts(text)[-MAX_ANSWER_LENGTH:]
    last_object, content, incomplete = _last_object(text, {parameter.name for parameter in problem.space.parameters})
    last_line, line_content = design_in_lines(text, per_joint(problem.space))
    if incomplete > max(last_line, last_object):
        raise DesignError(
            "the last JSON object is incomplete: give valid JSON with one value per parameter, and close its braces"
        )
    if max(last_line, last_object) < 0:
        raise DesignError(
            "no design found: give JSON with one value per parameter, or the lines ORIGIN, JOINTS and LINKS"
        )
    return read_answer(line_content if last_line > last_object else content, problem)


def last_json_object(text: str) -> str:
    """Return the last JSON object of a text as it is written there, or the text if it holds none."""
    text = text[-MAX_ANSWER_LENGTH:]
    starts = (match.start() for match in islice(re.finditer(r"\{", text), MAX_OBJECTS))
    spans = [(start, end) for start, end, content in _outermost_objects(text, starts) if content is not None]
    return text[slice(*spans[-1])] if spans else text


def per_joint(space: DesignSpace) -> dict[str, bool]:
    """Return the names of the custom parameters, and whether each has a value per joint."""
    return {name: custom.per is not None for name, custom in space.custom}


def response_schema(title: str, fields: Mapping[str, Any], of: str, options: PromptOptions) -> dict[str, Any]:
    """Return the JSON schema of a whole answer, with the model's analysis first if there is no call before it.

    `fields` are the schemas of the values; `of` is what the reason is the reason of.
    """
    reason = {"type": "string", "description": f"the main reason for {of}, in one sentence"}
    fields = {**fields, "reason": reason}
    if options.answer == "one-step":
        fields = {"reasoning": {"type": "string", "description": "your analysis, step by step"}, **fields}
    return {"title": title, "description": "What to evaluate next.", **object_schema(fields)}


def object_schema(fields: Mapping[str, Any], required: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the JSON schema of an object with these properties and no others; all are required by default."""
    needed = list(fields if required is None else required)
    return {"type": "object", "properties": dict(fields), "required": needed, "additionalProperties": False}


def _property(parameter: Parameter) -> dict[str, Any]:
    if isinstance(parameter, CategoricalParameter):
        return {"type": "string", "enum": list(parameter.choices)}
    description = f"{exact(parameter.low)} <= {parameter.name} <= {exact(parameter.high)} {parameter.unit}".rstrip()
    if parameter.step > 0.0 and not (parameter.integer and parameter.step == 1.0):
        description += f", in steps of {exact(parameter.step)}"
    return {"type": "integer" if parameter.integer else "number", "description": description}


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


def _number(value: Any, unit: str) -> Any:
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


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object. A repeated name gets a value that the design space refuses."""
    content: dict[str, Any] = {}
    for name, value in pairs:
        if name in content and content[name] != value:
            value = f"{content[name]} and {value}"
        content[name] = value
    return content


_decoder = json.JSONDecoder(object_pairs_hook=_without_repeats)


def _outermost_objects(text: str, starts: Iterable[int]) -> Iterator[tuple[int, int, dict[str, Any] | None]]:
    """Yield the positions and the content of JSON objects that begin there; no content if one is incomplete."""
    end = 0
    for start in starts:
        if start < end:
            continue
        try:
            content, end = _decoder.raw_decode(text, start)
        except (ValueError, RecursionError):
            content = None
        yield start, end, content


def _last_object(text: str, names: set[str]) -> tuple[int, dict[str, Any], int]:
    """Return the last outermost JSON object with a parameter, after its position, before that of an incomplete one.

    Positions are -1 if there is none.
    """
    names = {"origin", "joints", "links", *names}
    last, found, incomplete = -1, dict[str, Any](), -1
    starts = [match.start() for match in re.finditer(r'\{\s*"', text)][-MAX_OBJECTS:]
    for start, _, content in _outermost_objects(text, starts):
        if content is not None:
            if names & {str(name).lower() for name in content}:
                last, found = start, content
        elif any(f'"{name}"' in text[start : start + 200].lower() for name in names):
            incomplete = start
    return last, found, incomplete

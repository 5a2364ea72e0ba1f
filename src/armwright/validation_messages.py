"""Messages about values that are refused: the key, what is expected with its unit, what was found, what to try."""

import json
import math
import operator
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from types import NoneType
from typing import Any, Literal, cast, get_args, get_origin

from pydantic import PydanticUserError, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from armwright.exceptions import SettingsError, did_you_mean
from armwright.schema_types import all_keys_of, field_path, keys_of, members_of, owners_of, type_at
from armwright.units import KEY_UNITS, read_quantity

_MAX_INTEGER = 2**31 - 1
_COUNTS = {2: "two", 3: "three", 4: "four"}
_DIRECTIONS = {"down": [0, 0, -1], "up": [0, 0, 1]}
_BOUNDS = {
    "greater_than": "above",
    "greater_than_equal": "of at least",
    "less_than": "below",
    "less_than_equal": "of at most",
}
_TELLING = ("extra_forbidden", "value_error", *_BOUNDS)  # errors of a value of the right type
_MOST_ALTERNATIVES = 20  # errors of one value that are looked at
_LETTERS = re.compile(r"[^A-Za-z0-9._-]+")


def check_integer(name: str, value: Any, least: int) -> int:
    """Return the value as an int; SettingsError unless it is an integer from `least` on."""
    try:
        number = operator.index(value)  # accepts the integers of numpy
    except TypeError:
        number = -1
    if isinstance(value, bool) or not least <= number <= _MAX_INTEGER:
        raise SettingsError(f"{name}: expected a whole number from {least} to {_MAX_INTEGER}, got {value!r}")
    return number


def describe_fault(fault: ValidationError, schema: Any, data: Any) -> str:
    """Return what is wrong first in the whole `data`, on one line: `link[1]: expected a number [m], got "long"`."""
    found = [(field_path(error, schema), error) for error in fault.errors(include_url=False)[:_MOST_ALTERNATIVES]]
    start = found[0][0][:-1] if found[0][1]["type"] == "missing" else found[0][0]
    # Each alternative of a union has errors of its own: report that of the one that the value fits best. A key that is
    # missing may be misspelled.
    alternatives = [(path, error) for path, error in found if path[: len(start)] == start]
    path, error = max(alternatives, key=lambda one: (len(one[0]), one[1]["type"] in _TELLING))
    if error["type"] == "extra_forbidden":
        *path, key = path
        message = describe_unknown_key(str(key), path, schema, str([*error["loc"][-2:-1], ""][0]))
    else:
        message = _describe(error, path, schema, data)
    at = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")
    return f"{at}: {message}" if at else message


def describe_unknown_key(key: str, path: Sequence[str | int], schema: Any, alternative: str = "") -> str:
    """Return the keys that the record at a path has instead of an unknown one; alternative: of a union, as pydantic."""
    members = members_of(type_at(schema, path))
    named = [
        one for one in members if alternative in (getattr(one, "__name__", None), *get_args(keys_of(one).get("kind")))
    ]
    known = dict.fromkeys(name for record in named or members for name in all_keys_of(record))
    owners = owners_of(key, path, schema)
    place = f" It is a key of {' and '.join(owners)}." if owners else ""
    return f'unknown key "{key}".{did_you_mean(key, known)}{place} Allowed: {", ".join(known)}'


def _describe(error: ErrorDetails, path: Sequence[str | int], schema: Any, data: Any) -> str:
    """Return what is expected and what was found."""
    kind, given, limits = error["type"], error["input"], error.get("ctx", {})
    if kind in ("value_error", "assertion_error"):
        return error["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    annotation = type_at(schema, path)
    unit = KEY_UNITS.get(next((part for part in reversed(path) if isinstance(part, str)), ""), "")
    if kind == "missing" and isinstance(error["loc"][-1], str):
        return f"expected {_expected(annotation, unit)}, but the key is missing"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        key = limits["discriminator"].strip("'")
        tags = [tag for member in members_of(annotation) for tag in get_args(keys_of(member).get(key))]
        if kind == "union_tag_not_found":
            return f"{key}: expected {_choice(tags)}, but the key is missing"
        hint = did_you_mean(str(given[key]), tags)
        return f"{key}: expected {_choice(tags)}, got {show(given[key])}" + (f".{hint}" if hint else "")
    expected, hint = _limits(error, unit), ""
    if not expected:
        expected, around = _expected(annotation, unit), [_value_at(data, path[:-1])]
        is_entry = bool(path) and isinstance(path[-1], int) and _is_accepted(type_at(schema, path[:-1]), around)
        hint = show(around) if is_entry else _suggest(annotation, given, unit)
    if kind == "string_pattern_mismatch" and isinstance(given, str):
        hint = show(_LETTERS.sub("-", given).strip("-._")[:40]) if _LETTERS.search(given) else ""
    got = limits["actual_length"] if kind in ("too_short", "too_long") else show(given)
    return f"expected {expected}, got {got}" + (f"; try {hint}" if hint else "")


def _limits(error: ErrorDetails, unit: str) -> str:
    """Return which values are allowed, if the kind of value is right; an empty string if it is not."""
    kind, limits = error["type"], error.get("ctx", {})
    if kind in _BOUNDS:
        bound = next(iter(limits.values()))
        return f"a number {_BOUNDS[kind]} {bound:g} {unit}".rstrip()
    if kind == "finite_number":
        return f"a finite number{_in(unit)}"
    if kind.endswith(("too_short", "too_long")):
        number = limits.get("min_length", limits.get("max_length"))
        things = "characters" if kind.startswith("string") else "entry" if number == 1 else "entries"
        return f"at {'least' if kind.endswith('short') else 'most'} {number} {things}"
    if kind == "string_pattern_mismatch":
        pattern = str(limits["pattern"])
        name = re.fullmatch(r"\^\[[^]]*\]\[(A-Z)?a-z0-9._-\]\{0,(\d+)\}\$", pattern)
        if name is None:
            return f"text of the form {pattern}"
        letters = "letters" if name[1] else "lowercase letters"
        return f"a name of at most {int(name[2]) + 1} {letters}, digits and . _ - that begins with a letter or digit"
    return ""


def _expected(annotation: Any, unit: str = "") -> str:
    """Return the values of a type in words."""
    members = members_of(annotation)
    if sum(bool(keys_of(member)) for member in members) > 1:
        members = [member for member in members if not keys_of(member)]
        return " or ".join(filter(None, ["a record", *(_one_expected(member, unit) for member in members)]))
    kinds = list(dict.fromkeys(filter(None, (_one_expected(member, unit) for member in members))))
    return " or ".join(kinds) or "another value"


def _choice(names: Sequence[Any]) -> str:
    """Return alternatives in words."""
    return " or ".join(names) if len(names) <= 2 else f"one of {', '.join(names)}"


def _one_expected(annotation: Any, unit: str) -> str:
    if annotation in (float, int):
        return f"{'a number' if annotation is float else 'a whole number'}{_in(unit)}"
    if annotation in _WORDS:
        return _WORDS[annotation]
    entries = get_args(annotation)
    if get_origin(annotation) is Literal:
        return _choice(entries)
    if get_origin(annotation) is tuple:
        many = {float: "numbers", int: "whole numbers", str: "texts"}
        plain = many.get(members_of(entries[0])[0], "entries")
        if entries[-1] is not Ellipsis:
            return f"{_COUNTS.get(len(entries), len(entries))} {plain}{_in(unit)}"
        is_plain = plain != "entries"
        return f"a list of {plain}{_in(unit)}" if is_plain else f"a list, each entry {_expected(entries[0], unit)}"
    if keys := keys_of(annotation):
        return f"a record with the keys {', '.join(keys)}"
    return "keys and values" if get_origin(annotation) is not None else ""


_WORDS: Mapping[Any, str] = {str: "text", bool: "true or false", NoneType: ""}


def _in(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _suggest(annotation: Any, given: Any, unit: str) -> str:
    """Return a value that the user may have meant, the first repair that the type accepts; empty if there is none."""
    choices = [choice for m in members_of(annotation) if get_origin(m) is Literal for choice in get_args(m)]
    if isinstance(given, str) and len(given) > 1 and set(given) <= set(choices):
        return f"[{', '.join(given)}]"
    near = get_close_matches(given, choices, n=1) if isinstance(given, str) else []
    return next((show(repair) for repair in (*near, *_repairs(given, unit)) if _is_accepted(annotation, repair)), "")


def _repairs(given: Any, unit: str) -> Iterator[Any]:
    """Yield values that a value may stand for: `200 g` for a number, one entry for a list, and the like."""
    if isinstance(given, str):
        for parts in ([given], re.split(r"[,;]\s*|\s+", given.strip("[]() "))):
            numbers = [read_quantity(part, unit) for part in parts]
            known = [float(f"{number:.10g}") for number in numbers if number is not None]
            if len(known) == len(parts):
                yield known if len(parts) > 1 else known[0]
        yield from (_DIRECTIONS.get(given, given), [given])
    elif isinstance(given, list) and len(cast("list[Any]", given)) == 1:
        yield from cast("list[Any]", given)
    elif isinstance(given, (int, float)) and not isinstance(given, bool):
        yield from ([given], [given, given])
        if isinstance(given, float) and math.isfinite(given):
            yield round(given)
        yield show(given)


def _is_accepted(annotation: Any, value: Any) -> bool:
    """Return whether a value is one of a type."""
    try:
        TypeAdapter[Any](annotation).validate_python(value)
    except (ValidationError, PydanticUserError, OverflowError):
        return False
    return True


def show(value: Any) -> str:
    """Return a value as YAML reads it, shortened."""
    try:
        text = json.dumps(value, ensure_ascii=False, skipkeys=True, default=str)
    except ValueError:  # an integer of more than 4300 digits
        text = "a huge number"
    return text if len(text) <= 80 else text[:77] + "..."


def _value_at(data: Any, path: Sequence[str | int]) -> Any:
    """Return a part of a value; None if there is none."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data

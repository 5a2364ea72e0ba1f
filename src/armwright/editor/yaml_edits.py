"""Change single values of a YAML text: everything else stays as it was written, comments included."""

import copy
import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import yaml
from pydantic import BaseModel, Field
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError
from ruamel.yaml.representer import RoundTripRepresenter
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from armwright.exceptions import TaskError
from armwright.yaml_documents import load_document

MAX_DEPTH = 12


class Edit(BaseModel, frozen=True, extra="forbid"):
    """A new value of a key, or its removal.

    Attributes:
        path: Keys and indices from the root, such as ("targets", 0, "position"). An index one past the end appends.
        value: The new value, in JSON types.
        remove: Whether the key or item is removed instead.
    """

    path: tuple[str | int, ...] = Field(min_length=1, max_length=MAX_DEPTH)
    value: Any = None
    remove: bool = False


def edit_text(text: str, edits: Sequence[Edit], where: str) -> str:
    """Return the text with the edits applied, one after the other.

    Args:
        text: A YAML document with its keys in lines of their own, or an empty one.
        edits: The edits.
        where: Names the document in messages.

    Raises:
        TaskError: The text is no such document, or has no place for an edit.
    """
    for edit in edits:
        expected: Any = load_document(text, TaskError, where) if text.strip() else {}
        _apply(expected, edit, where, copy.deepcopy)
        text = _edited(text, edit, where)
        if load_document(text, TaskError, where) != expected:
            raise TaskError(f"{where}: cannot change {_name(edit.path)} here; change it in the text")
    return text


def _edited(text: str, edit: Edit, where: str) -> str:
    lines = text.splitlines(keepends=True)
    key = edit.path[0]
    first, end = _extents(text, where).get(str(key), (len(lines), len(lines)))
    before = lines[:first]
    if before and not before[-1].endswith("\n"):
        before[-1] += "\n"
    return "".join([*before, _edited_key("".join(lines[first:end]), edit, where), *lines[end:]])


def _edited_key(text: str, edit: Edit, where: str) -> str:
    """Return the text of one key of the root, and its value, with an edit applied."""
    try:
        content: Any = _yaml().load(text) if text else CommentedMap()
        _apply(content, edit, where, _styled)
        out = io.StringIO()
        if content:
            _yaml().dump(content, out)
    except (YAMLError, ValueError, TypeError, AttributeError, AssertionError) as fault:  # of the library, too
        raise TaskError(f"{where}: cannot change {_name(edit.path)} here; change it in the text") from fault
    return out.getvalue()


def _extents(text: str, where: str) -> dict[str, tuple[int, int]]:
    """Return the first line of each key of the root, and the line after its value; comments below it are not its."""
    root = cast("Any", yaml).compose(text, Loader=yaml.SafeLoader)
    if root is None:
        return {}
    if not isinstance(root, yaml.MappingNode) or root.flow_style:
        raise TaskError(f"{where}: expected keys and values, one a line")
    lines = text.splitlines()
    starts = [(str(key.value), int(key.start_mark.line)) for key, _ in cast("list[tuple[Any, Any]]", root.value)]
    ends = [line for _, line in starts[1:]] + [len(lines)]
    found: dict[str, tuple[int, int]] = {}
    for (key, first), end in zip(starts, ends, strict=True):
        while end > first + 1 and (not lines[end - 1].strip() or lines[end - 1].lstrip().startswith(("#", "..."))):
            end -= 1
        found[key] = first, end
    return found


def _apply(content: Any, edit: Edit, where: str, styled: Callable[[Any], Any]) -> None:
    """Change `content` in place; `styled` converts the new value."""
    place = content
    for step, following in zip(edit.path, edit.path[1:], strict=False):
        if isinstance(place, dict) and isinstance(step, str) and cast("Any", place).get(step) is None:
            place[step] = styled([] if isinstance(following, int) else {})
        place = _item(place, step, edit, where)
    last = edit.path[-1]
    if isinstance(place, dict) and isinstance(last, str):
        if edit.remove:
            place.pop(last, None)
        else:
            place[last] = styled(edit.value)
    elif isinstance(place, list) and isinstance(last, int) and 0 <= last < len(cast("Any", place)):
        if edit.remove:
            del place[last]
        else:
            place[last] = styled(edit.value)
    elif isinstance(place, list) and last == len(cast("Any", place)) and not edit.remove:
        place.append(styled(edit.value))
    else:
        raise TaskError(f"{where}: there is no {_name(edit.path)}")


def _item(place: Any, step: str | int, edit: Edit, where: str) -> Any:
    try:
        return place[step]
    except (KeyError, IndexError, TypeError) as fault:
        raise TaskError(f"{where}: there is no {_name(edit.path)}") from fault


def _name(path: Sequence[str | int]) -> str:
    """Return a path for messages, its items counted from 1: `targets 2, position`."""
    parts = [str(path[0])]
    for step in path[1:]:
        parts = [*parts[:-1], f"{parts[-1]} {step + 1}"] if isinstance(step, int) else [*parts, step]
    return ", ".join(parts)


def _styled(value: Any) -> Any:
    """Return a value with the style of task files: what holds no records and lists of lists is on one line."""
    if isinstance(value, Mapping):
        given = cast("Mapping[str, Any]", value)
        record = CommentedMap((key, _styled(item)) for key, item in given.items())
        if all(map(_is_short, given.values())):
            record.fa.set_flow_style()
        return record
    if isinstance(value, list):
        items = CommentedSeq(map(_styled, cast("list[Any]", value)))
        if _is_short(value):
            items.fa.set_flow_style()
        return items
    if isinstance(value, str) and _reads_as(value) != value:
        return DoubleQuotedScalarString(value)
    return value


def _is_short(item: Any) -> bool:
    """Return True for what fits into a record on one line."""
    if isinstance(item, list):
        return not any(isinstance(part, (dict, list)) for part in cast("list[Any]", item))
    return not isinstance(item, dict)


def _reads_as(text: str) -> Any:
    """Return what plain text means in YAML 1.1, in which `on` is true and `1:20` is 80."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return None


class _Representer(RoundTripRepresenter):
    """Writes numbers so that YAML 1.1 reads them as numbers: 1e-05 without a point is text."""


def _represent_float(representer: Any, value: float) -> Any:
    text = repr(value)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e")
    return representer.represent_scalar("tag:yaml.org,2002:float", text)


_Representer.add_representer(float, _represent_float)


def _yaml() -> YAML:
    made = YAML()
    made.Representer = _Representer
    made.preserve_quotes = True
    made.width = 2**20  # never folds a line
    made.indent(mapping=2, sequence=4, offset=2)
    return made

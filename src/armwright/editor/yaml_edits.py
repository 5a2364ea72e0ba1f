"""Change single values of a YAML text: everything else stays as it was written, comments included."""

import copy
import io
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
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
_TEXT_TAG = "tag:yaml.org,2002:str"


class Edit(BaseModel, frozen=True, extra="forbid"):
    """A new value of a key, or its removal."""

    # Keys and indices from the root, such as ("targets", 0, "position"); an index one past the end appends
    path: tuple[str | int, ...] = Field(min_length=1, max_length=MAX_DEPTH)
    value: Any = None  # in JSON types
    remove: bool = False  # remove the key or item instead


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
    root = cast("Any", yaml).compose(text, Loader=yaml.SafeLoader)
    if root is not None and (not isinstance(root, yaml.MappingNode) or root.flow_style):
        raise TaskError(f"{where}: expected keys and values, one a line")
    value = _value_on_a_line(root, edit)
    if value is not None:
        return text[: value.start_mark.index] + _flow(edit.value) + text[value.end_mark.index :]
    lines = text.splitlines(keepends=True)
    key = edit.path[0]
    first, end = _extents(root, text).get(str(key), (len(lines), len(lines)))
    before = lines[:first]
    if before and not before[-1].endswith("\n"):
        before[-1] += "\n"
    return "".join([*before, _edited_key("".join(lines[first:end]), edit, where), *lines[end:]])


def _edited_key(text: str, edit: Edit, where: str) -> str:
    """Return the text of one key of the root, and its value, with an edit applied."""
    try:
        content: Any = _yaml(text).load(text) if text else CommentedMap()
        _apply(content, edit, where, _styled)
        out = io.StringIO()
        if content:
            _yaml(text).dump(content, out)
    except (YAMLError, ValueError, TypeError, AttributeError, AssertionError) as fault:  # of the library, too
        raise TaskError(f"{where}: cannot change {_name(edit.path)} here; change it in the text") from fault
    return out.getvalue()


def _value_on_a_line(root: Any, edit: Edit) -> Any:
    """Return the node of an existing value if it and the new one are plain, quoted or in brackets; else None."""
    node = root
    for step in edit.path:
        if isinstance(node, yaml.MappingNode) and isinstance(step, str):
            pairs = cast("list[tuple[Any, Any]]", node.value)
            node = next((value for key, value in pairs if key.tag == _TEXT_TAG and key.value == step), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(step, int) and 0 <= step < len(node.value):
            node = cast("list[Any]", node.value)[step]
        else:
            return None
    if node is None or edit.remove or not _fits_a_line(edit.value):
        return None
    is_flow = node.style not in ("|", ">") if isinstance(node, yaml.ScalarNode) else node.flow_style
    return node if is_flow and node.start_mark.index < node.end_mark.index else None


def _flow(value: Any) -> str:
    """Return a value on one line, as it may stand in brackets."""
    style = '"' if isinstance(value, str) and _reads_as(value) != value else None
    flow: Any = {"default_flow_style": True, "default_style": style, "allow_unicode": True, "sort_keys": False}
    text: str = cast("Any", yaml).dump([value], Dumper=yaml.SafeDumper, width=2**20, **flow)
    return text.strip()[1:-1]


def _extents(root: Any, text: str) -> dict[str, tuple[int, int]]:
    """Return the first line of each key of the root, and the line after its value; comments below it are not its."""
    if root is None:
        return {}
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
        if _fits_a_line(value):
            record.fa.set_flow_style()
        return record
    if isinstance(value, list):
        items = CommentedSeq(map(_styled, cast("list[Any]", value)))
        if _fits_a_line(value):
            items.fa.set_flow_style()
        return items
    if isinstance(value, str) and _reads_as(value) != value:
        return DoubleQuotedScalarString(value)
    return value


def _fits_a_line(value: Any) -> bool:
    """Return True for a value that task files state on one line: one without records or lists of lists in it."""
    parts = cast("Mapping[str, Any]", value).values() if isinstance(value, Mapping) else [value]
    return all(map(_is_short, parts))


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


def _yaml(text: str) -> YAML:
    """Return a reader and writer of YAML with the indentation of a text."""
    mapping, offset = _indents(text)
    made = YAML()
    made.Representer = _Representer
    made.preserve_quotes = True
    made.width = 2**20  # never folds a line
    made.indent(mapping=mapping, sequence=offset + 2, offset=offset)
    return made


def _indents(text: str) -> tuple[int, int]:
    """Return by how much the first record and the first list are indented below their keys; by default 2."""
    found: dict[bool, int] = {}
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    for above, below in pairwise(lines):
        step = (len(below) - len(below.lstrip())) - (len(above) - len(above.lstrip()))
        is_list = below.lstrip().startswith("- ")
        if above.partition(" #")[0].rstrip().endswith(":") and above.lstrip()[0] != "-" and step >= (not is_list):
            found.setdefault(is_list, step)
    return found.get(False, 2), found.get(True, 2)

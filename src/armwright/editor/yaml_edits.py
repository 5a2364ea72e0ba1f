"""Change single values of a YAML text: everything else stays as it was written, comments included."""

import copy
import io
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, cast

import yaml
from pydantic import BaseModel, Field
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import YAMLError
from ruamel.yaml.representer import RoundTripRepresenter
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from armwright.exceptions import TaskError
from armwright.yaml_documents import SAFE_LOADER, load_document

MAX_DEPTH = 12


class Edit(BaseModel, frozen=True, extra="forbid"):
    """A new value of a key, or its removal."""

    # Keys and indices from the root, such as ("targets", 0, "position"); an index one past the end appends
    path: tuple[str | Annotated[int, Field(ge=0)], ...] = Field(min_length=1, max_length=MAX_DEPTH)
    value: Any = None  # in JSON types
    remove: bool = False  # remove the key or item instead


def edit_text(text: str, edits: Sequence[Edit], where: str) -> str:
    """Return the text with the edits applied, one after the other; messages call it `where`.

    The text is a YAML document with its keys in lines of their own, or an empty one.

    Raises:
        TaskError: The text is no such document, or has no place for an edit.
    """
    for edit in edits:
        expected: Any = load_document(text, TaskError, where) if text.strip() else {}
        _apply(expected, edit, where, copy.deepcopy)
        try:
            text = _edited(text, edit, where)
            is_done = load_document(text, TaskError, where) == expected
        except (YAMLError, ValueError, TypeError, AttributeError, AssertionError):  # of the library, too
            is_done = False
        if not is_done:
            raise TaskError(f"{where}: cannot change {_name(edit.path)} here; change it in the text")
    return text


def _edited(text: str, edit: Edit, where: str) -> str:
    """Return the text with the key of the root that an edit changes written again; other lines stay as they are."""
    lines = text.splitlines(keepends=True)
    first, end = _extent(text, str(edit.path[0]), where)
    before, own = "".join(lines[:first]), "".join(lines[first:end])
    content: Any = _yaml(own).load(own) if own else CommentedMap()
    _apply(content, edit, where, _styled)
    out = io.StringIO()
    if content:
        _yaml(own).dump(content, out)
    gap = "\n" if before and not before.endswith("\n") else ""
    return before + gap + out.getvalue() + "".join(lines[end:])


def _extent(text: str, key: str, where: str) -> tuple[int, int]:
    """Return the first line of a key of the root, and the line after its value; comments below it are not its."""
    root: Any = cast("Any", yaml).compose(text, Loader=SAFE_LOADER)
    if root is not None and (not isinstance(root, yaml.MappingNode) or root.flow_style):
        raise TaskError(f"{where}: expected keys and values, one a line")
    lines = text.splitlines()
    pairs = [] if root is None else cast("list[tuple[Any, Any]]", root.value)
    starts = [(str(name.value), int(name.start_mark.line)) for name, _ in pairs]
    ends = [line for _, line in starts[1:]] + [len(lines)]
    for (name, first), end in zip(starts, ends, strict=True):
        if name == key:
            while end > first + 1 and (not lines[end - 1].strip() or lines[end - 1].lstrip().startswith(("#", "..."))):
                end -= 1
            return first, end
    return len(lines), len(lines)


def _apply(content: Any, edit: Edit, where: str, styled: Callable[[Any], Any]) -> None:
    """Change `content` in place; `styled` converts the new value."""
    place, last = content, edit.path[-1]
    try:
        for step, following in pairwise(edit.path):
            if isinstance(place, dict) and isinstance(step, str) and cast("Any", place).get(step) is None:
                place[step] = styled([] if isinstance(following, int) else {})
            place = cast("Any", place)[step]
        is_record, is_list = isinstance(place, dict), isinstance(place, list)
        if not (is_record if isinstance(last, str) else is_list):
            raise TypeError("expected a key of a record, or the index of an item")
        if edit.remove and is_record:
            place.pop(last, None)
        elif edit.remove:
            del place[last]
        elif is_list and last == len(place):
            place.append(styled(edit.value))
        else:
            place[last] = styled(edit.value)
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
    if isinstance(value, (Mapping, list)):
        is_record, given = isinstance(value, Mapping), cast("Any", value)
        made: Any = (
            CommentedMap((k, _styled(v)) for k, v in given.items()) if is_record else CommentedSeq(map(_styled, given))
        )
        if _fits_a_line(value):
            made.fa.set_flow_style()
        return made
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

"""Types of the parts of a pydantic schema, for messages about it."""

from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic_core import ErrorDetails


def members_of(annotation: Any) -> list[Any]:
    """Return the types of a union without annotations; of any other type, itself."""
    if get_origin(annotation) is Annotated:
        return members_of(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [member for part in get_args(annotation) for member in members_of(part)]
    return [] if annotation is None else [annotation]


def type_at(schema: Any, path: Sequence[str | int]) -> Any:
    """Return the type of a part of a schema; None if it is unknown."""
    if not path:
        return schema
    for member in members_of(schema):
        inner = _entry_type(member, path[0]) if isinstance(path[0], int) else keys_of(member).get(path[0])
        if get_origin(member) in (dict, Mapping):
            inner = get_args(member)[1]
        if inner is not None and (found := type_at(inner, path[1:])) is not None:
            return found
    return None


def _entry_type(annotation: Any, index: int) -> Any:
    """Return the type of an entry of a list; None if the type is no list, or a shorter one."""
    entries = get_args(annotation) if get_origin(annotation) in (tuple, list) else ()
    if len(entries) == 1 or (entries and entries[-1] is Ellipsis):
        return entries[0]
    return entries[index] if index < len(entries) else None


def owners_of(key: str, path: Sequence[str | int], schema: Any) -> list[str]:
    """Return the records around or within the one at a path that have this key: `targets` for `axis` in a task."""
    for end in reversed(range(len(path))):
        if key in all_keys_of(type_at(schema, path[:end])):
            return [part for part in path[:end] if isinstance(part, str)][-1:] or ["the file itself"]
    record = all_keys_of(type_at(schema, path))
    return [name for name, annotation in record.items() if key in all_keys_of(annotation)]


def all_keys_of(annotation: Any) -> dict[str, Any]:
    """Return the keys of a record, or of any record in a union or a list."""
    found: dict[str, Any] = {}
    for member in members_of(annotation):
        found |= keys_of(member)
        if get_origin(member) is tuple:
            found |= all_keys_of(get_args(member)[0])
    return found


@cache
def keys_of(annotation: Any) -> Mapping[str, Any]:
    """Return the types of the keys of a record; empty for anything else."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return {field.alias or name: field.annotation for name, field in annotation.model_fields.items()}
    if isinstance(annotation, type) and is_dataclass(annotation):
        return {
            name: hint
            for name, hint in get_type_hints(annotation, include_extras=True).items()
            if name[0] != "_" and "ClassVar" not in str(hint)
        }
    return {}


def field_path(error: ErrorDetails, schema: Any) -> list[str | int]:
    """Return where an error is, without the names of types that pydantic adds for unions.

    A list that is too short is at fault itself, not the entry that is missing.
    """
    path: list[str | int] = []
    for part in error["loc"]:
        is_unknown_key = error["type"] == "extra_forbidden" and part == error["loc"][-1]
        if isinstance(part, int) or not path or is_unknown_key or type_at(schema, [*path, part]) is not None:
            path.append(part)
    return path[:-1] if error["type"] == "missing" and path and isinstance(path[-1], int) else path

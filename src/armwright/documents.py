"""YAML documents that people write: read safely, checked against a schema, refused in one line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ValidationError

from armwright.exceptions import ArmwrightError, did_you_mean

Schema = TypeVar("Schema", bound=BaseModel)

LARGEST_DOCUMENT = 4 * 1024 * 1024  # [bytes]; a task of 10,000 targets has some 0.3 MB


def read_document(path: Path, schema: type[Schema], error: type[ArmwrightError]) -> Schema:
    """The content of a YAML file as a value of `schema`; `error` in one line where it is not one."""
    try:
        if path.stat().st_size > LARGEST_DOCUMENT:
            raise error(f"{path} is larger than {LARGEST_DOCUMENT // 2**20} MiB; that is not a file for this purpose")
        text = path.read_text(encoding="utf-8")
    except OSError as fault:
        raise error(f"cannot read {path}: {fault.strerror or fault}") from fault
    except UnicodeDecodeError as fault:
        raise error(f"{path} is not a text file in UTF-8") from fault
    return parse_document(text, schema, error, str(path))


def parse_document(text: str, schema: type[Schema], error: type[ArmwrightError], where: str) -> Schema:
    """The YAML `text` as a value of `schema`; `where` names it in messages."""
    try:
        data = yaml.load(text, Loader=_DocumentLoader)
    except (yaml.YAMLError, RecursionError, ValueError) as fault:
        raise error(f"{where} is not valid YAML: {_yaml_fault(fault)}") from fault
    if not isinstance(data, dict):
        raise error(f"{where} must hold keys and values ({', '.join(schema.model_fields)}), one a line")
    return check_document(cast("dict[Any, Any]", data), schema, error, where)


def check_document(data: dict[Any, Any], schema: type[Schema], error: type[ArmwrightError], where: str) -> Schema:
    """`data` as a value of `schema`; `where` names it in messages."""
    for key in data:
        if key not in schema.model_fields:
            allowed = ", ".join(schema.model_fields)
            raise error(
                f'{where}: unknown key "{key}". Allowed: {allowed}.{did_you_mean(str(key), schema.model_fields)}'
            )
    try:
        return schema.model_validate(data)
    except ValidationError as fault:
        first = fault.errors(include_url=False, include_context=False)[0]
        at = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
        words = first["msg"].removeprefix("Value error, ")
        got = "" if first["type"] in ("missing", "value_error") else f" (got {_shorten(first['input'])})"
        raise error(f"{where}: {at + ': ' if at else ''}{words}{got}") from fault


class _DocumentLoader(yaml.SafeLoader):
    """Safe YAML without aliases (no task needs them, and they are how a small file fills the memory)."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("anchors and aliases (&, *) are not allowed")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen: set[str] = set()
        for key in _scalar_keys(node):
            if key in seen:
                raise yaml.YAMLError(f'the key "{key}" stands there twice')
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


def _scalar_keys(node: Any) -> Iterator[str]:
    for key, _ in getattr(node, "value", ()):
        if isinstance(key, yaml.ScalarNode):
            yield str(key.value)


def _yaml_fault(fault: Exception) -> str:
    mark = getattr(fault, "problem_mark", None)
    problem = getattr(fault, "problem", None)
    if mark is not None and problem:
        return f"{problem}, line {mark.line + 1}, column {mark.column + 1}"
    return "nested too deeply" if isinstance(fault, RecursionError) else _shorten(fault)


def _shorten(value: object) -> str:
    text = str(value).replace("\n", " ")
    return text if len(text) <= 80 else text[:77] + "..."

"""Untrusted YAML documents: read safely, checked against a schema, refused with a one-line error."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ValidationError
from yaml.composer import Composer

from armwright.files import read_text
from armwright.text import one_line
from armwright.validation_messages import describe_fault, describe_unknown_key

Schema = TypeVar("Schema", bound=BaseModel)

MAX_BYTES = 4 * 1024 * 1024  # [bytes]; a task of 10,000 targets has about 0.3 MB
MAX_NODES = 400_000  # values in a document; 10,000 targets with all their keys have 240,000


def read_document(path: Path, schema: type[Schema], error: type[Exception]) -> Schema:
    """Read a YAML file as a value of `schema`; raise `error` with a one-line message if it is not one."""
    return parse_document(read_text(path, MAX_BYTES, error), schema, error, path)


def parse_document(text: str, schema: type[Schema], error: type[Exception], where: str | Path) -> Schema:
    """Parse YAML text as a value of `schema`; `where` names it in messages, and files beside it if it is a path."""
    data = load_document(text, error, str(where))
    if not isinstance(data, dict):
        raise error(f"{where} must hold keys and values ({', '.join(document_keys(schema))}), one a line")
    return check_document(cast("dict[Any, Any]", data), schema, error, where)


def load_document(text: str, error: type[Exception], where: str) -> Any:
    """Return the content of YAML text without checking it against a schema."""
    try:
        return yaml.load(text, Loader=_DocumentLoader)
    except (yaml.YAMLError, RecursionError, ValueError) as fault:
        raise error(f"{where} is not valid YAML: {_yaml_fault(fault)}") from fault


def check_document(data: dict[Any, Any], schema: type[Schema], error: type[Exception], where: str | Path) -> Schema:
    """Validate `data` as a value of `schema`; `where` names it in messages, and files beside it if it is a path."""
    for key in data:
        if key not in document_keys(schema) and schema.model_config.get("extra") != "allow":
            raise error(f"{where}: {describe_unknown_key(str(key), (), schema)}")
    try:
        return schema.model_validate(data, context=where.parent if isinstance(where, Path) else None)
    except ValidationError as fault:
        raise error(f"{where}: {describe_fault(fault, schema, data)}") from fault


def document_keys(schema: type[BaseModel]) -> dict[str, str]:
    """Return the fields of a schema by the keys that a document states them under."""
    return {field.alias or name: name for name, field in schema.model_fields.items()}


def dump_document(content: Mapping[str, Any]) -> str:
    """Return content as YAML, without aliases, and with points on one line."""
    return yaml.dump(dict(content), Dumper=_DocumentDumper, sort_keys=False, allow_unicode=True)


# libyaml, if PyYAML was built with it, is five times as fast.
SAFE_LOADER: Any = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader


class _DocumentLoader(SAFE_LOADER):
    """Safe YAML without features that let a small file fill the memory or take hours.

    Refused are aliases, tags (PyYAML fails at an invalid `!!int`) and numbers in base 60 (quadratic time).
    """

    # libyaml composes in C, without calling compose_node.
    get_single_node = Composer.get_single_node
    compose_document = Composer.compose_document
    compose_scalar_node = Composer.compose_scalar_node
    compose_sequence_node = Composer.compose_sequence_node
    compose_mapping_node = Composer.compose_mapping_node

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.anchors: dict[str, Any] = {}
        self._nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self._nodes += 1
        if self._nodes > MAX_NODES:
            raise yaml.YAMLError(f"expected at most {MAX_NODES:,} values")
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("anchors and aliases (&, *) are not allowed")
        tag = getattr(self.peek_event(), "tag", None)
        if tag is not None:
            raise yaml.YAMLError(f"tags ({tag}) are not allowed; quote text that begins with !")
        return Composer.compose_node(cast("Any", self), parent, index)

    def construct_scalar(self, node: Any) -> Any:
        if node.tag in _NUMBER_TAGS and ":" in node.value:
            raise yaml.YAMLError(f"{node.value[:20]} is a number in base 60; quote it if it is text")
        return super().construct_scalar(node)  # pyright: ignore[reportUnknownVariableType]

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen: set[str] = set()
        for key in (str(key.value) for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key in seen:
                raise yaml.YAMLError(f'duplicate key "{key}"')
            seen.add(key)
        return super().construct_mapping(node, deep=deep)  # pyright: ignore[reportUnknownVariableType]


_NUMBER_TAGS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


def _yaml_fault(fault: Exception) -> str:
    mark = getattr(fault, "problem_mark", None)
    problem = getattr(fault, "problem", None)
    if mark is not None and problem:
        return f"{problem}, line {mark.line + 1}, column {mark.column + 1}"
    return "nested too deeply" if isinstance(fault, RecursionError) else one_line(str(fault), 80)


class _DocumentDumper(yaml.SafeDumper):
    """YAML without aliases, points on one line."""

    def ignore_aliases(self, data: Any) -> bool:
        return True

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> yaml.SequenceNode:
        plain = all(not isinstance(item, (dict, list)) for item in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain)

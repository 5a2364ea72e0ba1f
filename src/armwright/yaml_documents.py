"""YAML documents that people write: read safely, checked against a schema, refused in one line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ValidationError
from yaml.composer import Composer

from armwright.exceptions import did_you_mean

Schema = TypeVar("Schema", bound=BaseModel)

LARGEST_DOCUMENT = 4 * 1024 * 1024  # [bytes]; a task of 10,000 targets has some 0.3 MB
RENAMED = {"jitter": "target_noise"}  # keys of files
MOST_NODES = 400_000  # values in a document; of 10,000 targets that say all that a target can there are 240,000


def read_document(path: Path, schema: type[Schema], error: type[Exception]) -> Schema:
    """The content of a YAML file as a value of `schema`; `error` in one line where it is not one."""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_DOCUMENT + 1)  # not its size, which a device does not have
        text = data.decode("utf-8")
    except UnicodeDecodeError as fault:
        raise error(f"{path} is not a text file in UTF-8") from fault
    except (OSError, ValueError) as fault:  # the latter of a name with a NUL
        raise error(f"cannot read {path}: {getattr(fault, 'strerror', None) or fault}") from fault
    if len(data) > LARGEST_DOCUMENT:
        raise error(f"{path} is larger than {LARGEST_DOCUMENT // 2**20} MiB; that is not a file for this purpose")
    return parse_document(text, schema, error, str(path))


def parse_document(text: str, schema: type[Schema], error: type[Exception], where: str) -> Schema:
    """The YAML `text` as a value of `schema`; `where` names it in messages."""
    try:
        data = yaml.load(text, Loader=_DocumentLoader)
    except (yaml.YAMLError, RecursionError, ValueError) as fault:
        raise error(f"{where} is not valid YAML: {_yaml_fault(fault)}") from fault
    if not isinstance(data, dict):
        raise error(f"{where} must hold keys and values ({', '.join(schema.model_fields)}), one a line")
    return check_document(cast("dict[Any, Any]", data), schema, error, where)


def check_document(data: dict[Any, Any], schema: type[Schema], error: type[Exception], where: str) -> Schema:
    """`data` as a value of `schema`; `where` names it in messages."""
    for key in data:
        if key not in schema.model_fields:
            allowed = ", ".join(schema.model_fields)
            hint = did_you_mean(str(key), schema.model_fields, RENAMED)
            raise error(f'{where}: unknown key "{key}". Allowed: {allowed}.{hint}')
    try:
        return schema.model_validate(data)
    except ValidationError as fault:
        first = fault.errors(include_url=False, include_context=False)[0]
        at = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
        words = first["msg"].removeprefix("Value error, ")
        got = "" if first["type"] in ("missing", "value_error") else f" (got {_shorten(first['input'])})"
        raise error(f"{where}: {at + ': ' if at else ''}{words}{got}") from fault


# libyaml, where PyYAML has it, reads five times as fast.
_Loader: Any = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader


class _DocumentLoader(_Loader):
    """Safe YAML without what no document needs, and by which a small file fills the memory, or does not end.

    Aliases; tags (PyYAML fails at a `!!int` that is none); numbers in base 60, of which a long one takes hours.
    """

    # libyaml composes without asking anybody.
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
        if self._nodes > MOST_NODES:
            raise yaml.YAMLError(f"more than {MOST_NODES:,} values; that is not a file for this purpose")
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("anchors and aliases (&, *) are not allowed")
        tag = getattr(self.peek_event(), "tag", None)
        if tag is not None:
            raise yaml.YAMLError(f"tags ({tag}) are not allowed; quote a text that begins with !")
        return Composer.compose_node(cast("Any", self), parent, index)

    def construct_scalar(self, node: Any) -> Any:
        if node.tag in _NUMBER_TAGS and ":" in node.value:
            raise yaml.YAMLError(f"{node.value[:20]} is a number in base 60; quote it where it is a text")
        return super().construct_scalar(node)  # pyright: ignore[reportUnknownVariableType]

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        seen: set[str] = set()
        for key in _scalar_keys(node):
            if key in seen:
                raise yaml.YAMLError(f'the key "{key}" stands there twice')
            seen.add(key)
        return super().construct_mapping(node, deep=deep)  # pyright: ignore[reportUnknownVariableType]


_NUMBER_TAGS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


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
    try:
        text = str(value).replace("\n", " ")
    except ValueError:  # of more than 4300 digits
        text = "a huge number"
    return text if len(text) <= 80 else text[:77] + "..."

"""The YAML files that people write, told from the models that load them: keys, kinds, bounds, defaults, units, words.

Words and units are those of the code, too: a model's docstring (`key: words`) and the comments behind its fields.
"""

import ast
import inspect
import io
import re
import tokenize
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args, get_origin

import annotated_types as at
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from armwright import moves, space, task
from armwright.catalogue import ActuatorRecord
from armwright.experiment import plan
from armwright.experiment.plan import ExperimentPlan, FigurePlan, MethodPlan
from armwright.llm.configuration import _ConfigurationFile  # pyright: ignore[reportPrivateUsage]
from armwright.masses import MassOfTube, MassPerLink, MassPerMetre
from armwright.obstacles import Box, Cylinder, Ground, Sphere
from armwright.space import DesignSpace
from armwright.starts import DesignFile
from armwright.targets import LARGEST_COORDINATE, Target
from armwright.task import Task
from armwright.workspace import Region
from website.commands import commands
from website.words import taken_apart

_UNIT = re.compile(r"\s*\[(m|rad|m/rad|rad/s|kg|kg/m|kg/m³|s|N m|V|USD)\](?=[.;]?(?:\s|$))")
_ENDLESS = 2**31 - 1  # as a bound it is none that anybody would meet
TITLES: Mapping[type[BaseModel], str] = {
    Task: "A task", Target: "A target", Region: "A region", Box: "Box", Sphere: "Sphere", Cylinder: "Cylinder",
    Ground: "Ground", DesignSpace: "A design space", MassPerMetre: "Mass per metre", MassPerLink: "Mass per link",
    MassOfTube: "Mass of a tube", ActuatorRecord: "An actuator", ExperimentPlan: "An experiment",
    MethodPlan: "A method", FigurePlan: "A figure", DesignFile: "A design",
    _ConfigurationFile: "The configuration",
}  # fmt: skip
# What a file's keys are besides: of values that may have several forms, and of bounds that validators hold.
# Numbers are the code's own.
KINDS: Mapping[tuple[type[BaseModel], str], str] = {
    (Task, "targets"): "list of `[x, y, z]` or [targets](#a-target)",
    (Task, "moves"): "`in_order`, or list of pairs of whole numbers",
    (Task, "workspace"): "[region](#a-region), or list of these",
    (DesignSpace, "actuators"): "list of names of the catalogue or [actuators](#an-actuator)",
    (DesignSpace, "restrict"): "name: number, choice, `[low, high]` or list of choices",
    (DesignSpace, "grid"): "name or kind: number",
    (DesignSpace, "tie"): "name: name",
}
BOUNDS: Mapping[tuple[type[BaseModel], str], str] = {
    (Task, "targets"): f"1 to {task.MOST_TARGETS:,}; coordinates within ±{LARGEST_COORDINATE:,g}",
    (Task, "payload"): f"0 to {task.LARGEST_PAYLOAD:,g}",
    (Task, "obstacles"): f"at most {task.MOST_OBSTACLES}",
    (Task, "moves"): f"at most {moves.MOST_STEPS} steps a move, {moves.MOST_SAMPLES:,} samples in all",
    (Task, "move_time"): f"above 0, at most {moves.LONGEST_TIME:,g}",
    (Task, "workspace"): f"at most {task.MOST_REGIONS} regions, {task.MOST_POINTS:,} points in all",
    (Task, "reference_point"): "above 0",
    (DesignSpace, "joints"): f"1 to {space.MOST_MODULES}",
    (DesignSpace, "joint_range"): f"within ±{space.LARGEST_ANGLE:.4g}; holds 0",
    (DesignSpace, "limit"): f"{space.LEAST_TURN / 2:.4g} to {space.LARGEST_ANGLE:.4g}",
    (DesignSpace, "stroke"): f"{space.LEAST_STROKE:g} to {space.LARGEST_LENGTH:,g}",
    (DesignSpace, "link"): f"above 0, at most {space.LARGEST_LENGTH:,g}",
    (DesignSpace, "tool"): f"within ±{space.LARGEST_LENGTH:,g}",
    **{(DesignSpace, f"origin_{axis}"): f"within ±{space.LARGEST_LENGTH:,g}" for axis in "xyz"},
    (ExperimentPlan, "seeds"): f"1 to {plan.MOST_SEEDS:,}, or a list of different ones",
}


@dataclass(frozen=True)
class Key:
    """A key of a file."""

    name: str
    kind: str
    bounds: str
    default: str  # empty where the key must be given
    unit: str
    words: str
    is_needed: bool


def page(title: str, words: str, models: Sequence[type[BaseModel]]) -> str:
    """The reference of one kind of file, as Markdown: its own keys, then those of the records within."""
    parts = [f"# {title}", words]
    for model in models:
        rows = [
            f"| `{key.name}` | {key.kind} | {key.bounds} | {key.unit} | {_default(key)} | {cell(key.words)} |"
            for key in keys_of(model)
        ]
        head = ["| key | | bounds | unit | default | |", "|---|---|---|---|---|---|"]
        parts += [f"## {TITLES[model]}", _intro(model), "\n".join([*head, *rows])]
    return "\n\n".join(part for part in parts if part) + "\n"


def keys_of(model: type[BaseModel]) -> list[Key]:
    """The keys of a file or record, in their order."""
    told = taken_apart(_docstring(model), tuple(model.model_fields))[1]
    source = _source_of(model)
    fields = {name: field for name, field in model.model_fields.items() if field.annotation is not Any}
    return [_key(model, name, field, told.get(name, ""), source) for name, field in fields.items()]


def _key(model: type[BaseModel], name: str, field: FieldInfo, told: str, source: "_Source") -> Key:
    said = source.comments.get(name, "")
    units = set(_UNIT.findall(told) or _UNIT.findall(said)) or source.units_of(name)
    unit = units.pop() if len(units) == 1 else ""
    words = told or said or _of_option(model, name)
    bounds = [BOUNDS[model, name]] if (model, name) in BOUNDS else _bounds(name, field)
    return Key(
        name=name,
        kind=KINDS.get((model, name)) or _kind(field.annotation),
        bounds="; ".join(bounds),
        default="" if field.is_required() else _shown(field.get_default(call_default_factory=True)),
        unit=unit,
        words=(_UNIT.sub("", words) if unit else words).strip(" ;"),
        is_needed=field.is_required(),
    )


def _of_option(model: type[BaseModel], name: str) -> str:
    """What the command line says, of what a method has in common with it."""
    if model is not MethodPlan:
        return ""
    options = {option.name: option.help for option in commands()["optimize"].params}
    return options[name].split("  [default:")[0]


def _docstring(model: type[BaseModel]) -> str:
    return inspect.cleandoc(vars(model).get("__doc__") or "")


def _intro(model: type[BaseModel]) -> str:
    words, _ = taken_apart(_docstring(model), tuple(model.model_fields))
    return words


def _kind(annotation: Any) -> str:
    """What a value is, in words."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _kind(parts[0])
    if origin is Literal:
        return ", ".join(f"`{part}`" for part in parts)
    if origin in (typing.Union, types.UnionType):
        found = [_kind(part) for part in parts if part is not type(None)]
        return " or ".join(dict.fromkeys(found))
    if origin is tuple:
        if parts[-1] is Ellipsis:
            return f"list of {_many(_kind(parts[0]))}"
        kinds = {_kind(part) for part in parts}
        return f"{len(parts)} {_many(kinds.pop())}" if len(kinds) == 1 else f"[{', '.join(map(_kind, parts))}]"
    if origin is dict:
        return f"{_kind(parts[0])}: {_kind(parts[1])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return f"[{TITLES[annotation].lower()}](#{TITLES[annotation].lower().replace(' ', '-')})"
    return {float: "number", int: "whole number", str: "text", bool: "`true` or `false`"}[annotation]


def _many(kind: str) -> str:
    return {"number": "numbers", "whole number": "whole numbers", "text": "texts"}.get(kind, kind)


def _bounds(name: str, field: FieldInfo) -> list[str]:
    """What the models themselves hold values to: the field's own bounds, else those of what it consists of.

    How a name may be written is said of names alone.
    """
    found = _of_metadata(field.metadata) or _within(field.annotation)
    return [bound for bound in found if name == "name" or not bound.startswith("`")]


def _within(annotation: Any) -> list[str]:
    if get_origin(annotation) is Annotated:
        base, *metadata = get_args(annotation)
        return _of_metadata(_flat(metadata)) or _within(base)
    parts = [part for part in get_args(annotation) if part not in (Ellipsis, type(None))]
    if get_origin(annotation) is Literal:
        return []
    return list(dict.fromkeys(bound for part in parts for bound in _within(part)))


def _flat(metadata: Sequence[Any]) -> list[Any]:
    return [one for part in metadata for one in (part.metadata if isinstance(part, FieldInfo) else (part,))]


def _of_metadata(metadata: Sequence[Any]) -> list[str]:
    held = {type(part): part for part in metadata}
    words: list[str] = []
    low = held[at.Ge].ge if at.Ge in held else held[at.Gt].gt if at.Gt in held else None
    high = held[at.Le].le if at.Le in held and held[at.Le].le != _ENDLESS else None
    if low is not None and high is not None:
        words = [f"above {_n(low)}, at most {_n(high)}" if at.Gt in held else f"{_n(low)} to {_n(high)}"]
        words = [f"within ±{_n(high)}"] if low == -high else words
    elif low is not None:
        words = [f"above {_n(low)}" if at.Gt in held else f"at least {_n(low)}"]
    if at.MinLen in held:
        words.append("not empty")
    if at.MaxLen in held:
        words.append(f"at most {held[at.MaxLen].max_length:,} long")
    patterns = [part.pattern for part in metadata if getattr(part, "pattern", None)]
    return words + [f"`{pattern.strip('^$')}`" for pattern in patterns]


def _n(value: float) -> str:
    return f"{value:,.0f}" if value == int(value) else f"{value:.4g}"


def _shown(value: Any) -> str:
    if value is None or value is PydanticUndefined or value in ((), "", {}):
        return "none"
    if isinstance(value, BaseModel):
        return f"`{{{', '.join(f'{k}: {v}' for k, v in value.model_dump().items())}}}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return f"`[{', '.join(map(str, value))}]`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _default(key: Key) -> str:
    return "**needed**" if key.is_needed else key.default


def cell(words: str) -> str:
    """Words within a table."""
    return words.replace("|", "\\|")


@dataclass(frozen=True)
class _Source:
    """comments: behind or above a field. units: of the names that its annotation is made of."""

    comments: Mapping[str, str]
    annotations: Mapping[str, str]
    units: Mapping[str, str]

    def units_of(self, name: str) -> set[str]:
        """By the kinds of number that a field is made of: `Coordinate = ...  # [m]`."""
        annotation = self.annotations.get(name, "")
        if "Literal" in annotation:  # a name, or numbers of another meaning
            return set()
        return {self.units[one] for one in re.findall(r"\w+", annotation) if one in self.units}


def _source_of(model: type[BaseModel]) -> _Source:
    module = inspect.getmodule(model)
    assert module is not None
    text = inspect.getsource(module)
    comments = _comments(text)
    tree = ast.parse(text)
    (body,) = [node.body for node in tree.body if isinstance(node, ast.ClassDef) and node.name == model.__name__]
    fields = [node for node in body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)]
    aliases = [node for node in tree.body if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)]
    units = {
        node.targets[0].id: found[1]
        for node in aliases
        if (found := _UNIT.search(comments.get(node.end_lineno or 0, "")))
    }
    for node in aliases:  # of those that are made of the ones before
        made_of = [one for one in re.findall(r"\w+", ast.unparse(node.value)) if one in units]
        if made_of:
            units.setdefault(node.targets[0].id, units[made_of[0]])
    lines = text.splitlines()
    above = {node: comments.get(node.lineno - 1, "") for node in fields}
    return _Source(
        comments={
            node.target.id: comments.get(node.end_lineno or 0, "")
            or (above[node] if lines[node.lineno - 2].lstrip().startswith("#") else "")
            for node in fields
        },
        annotations={node.target.id: ast.unparse(node.annotation) for node in fields},
        units=units,
    )


def _comments(text: str) -> dict[int, str]:
    """By the line that they stand on."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return {
        token.start[0]: token.string.lstrip("# ")
        for token in tokens
        if token.type == tokenize.COMMENT and "pyright" not in token.string
    }

"""The question that asks a language model for a task and a design space, and the schema of its answer.

The schema is made from the models that load the files, so a key that is new there is known here.
"""

from typing import Any, cast

from pydantic import BaseModel, Field

from armwright.exceptions import SettingsError
from armwright.llm.prompt import rendered
from armwright.problem.objectives import MAX_OBJECTIVES, OBJECTIVES, PAPER_OBJECTIVES
from armwright.robot.actuators import ActuatorRecord, catalogue
from armwright.robot.tubes import MATERIALS
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS
from armwright.tasks.task import MAX_TARGETS, Task
from armwright.text import end_of, fence

MAX_DESCRIPTION_LENGTH = 10_000  # characters; longer ones hold points, which `armwright init --from` reads


class DraftAnswer(BaseModel):
    """A task, and a design space if the default does not fit."""

    reasoning: str = Field(description="where base, floor and work lie, which targets follow, how far they are")
    task: Task
    space: DesignSpace | None = None
    assumptions: list[str] = Field(description="what was assumed, one sentence each, with the number and the reason")
    questions: list[str] = Field(default=[], description="what the engineer should clarify, one sentence each")


def draft_prompt(description: str) -> str:
    """Return the question for a description of what the arm has to do; SettingsError if it is empty or too long."""
    shown = end_of(description.strip(), len(description))
    if not shown.strip():
        raise SettingsError('the description is empty; try armwright draft "reach the corners of a 0.5 m cube"')
    if len(description) > MAX_DESCRIPTION_LENGTH:
        raise SettingsError(
            f"the description has {len(description):,} characters; expected at most {MAX_DESCRIPTION_LENGTH:,}. "
            "armwright init --from FILE reads points"
        )
    space = DesignSpace()
    ranges = (space.origin_x, space.origin_y, space.origin_z)
    values = {
        "description": shown,
        "fence": fence(shown),
        "most_targets": MAX_TARGETS,
        "reach": space.max_reach,
        "bases": ", ".join(f"{low:g} <= {axis} <= {high:g}" for axis, (low, high) in zip("xyz", ranges, strict=True)),
        "toy": space.link_description,
        "most_objectives": MAX_OBJECTIVES,
        "paper_objectives": " and ".join(objective.name for objective in PAPER_OBJECTIVES),
        "objectives": tuple(OBJECTIVES.values()),
        "joint_descriptions": JOINT_DESCRIPTIONS,
        "actuators": [_actuator_line(record) for record in catalogue().values()],
    }
    return rendered("draft.md.j2", values)


def draft_schema() -> dict[str, Any]:
    """Return the JSON schema of the answer, in which actuators and materials are names."""
    schema = _plain(DraftAnswer.model_json_schema(mode="serialization"))
    actuators = schema["$defs"]["DesignSpace"]["properties"]["actuators"]
    actuators["items"] = {"type": "string", "enum": list(catalogue())}
    schema["$defs"]["LinkSection"]["properties"]["material"] = {"type": "string", "enum": list(MATERIALS)}
    del schema["$defs"]["DesignSpace"]["properties"]["parameters"]  # only evaluators use them
    obstacle = schema["$defs"]["Task"]["properties"]["obstacles"]["items"]
    del obstacle["discriminator"]  # each kind has its own constant
    obstacle["oneOf"].remove({"$ref": "#/$defs/Mesh"})  # whose file a model does not have
    for record in ("ActuatorRecord", "Material", "Mesh"):
        del schema["$defs"][record]
    return schema


def _plain(schema: Any) -> Any:
    """Return a schema without titles, which repeat the names, and with tuples of one type as arrays of it.

    Not all servers know `prefixItems`. Optional keys that may be null are left out instead. So are empty defaults, and
    the largest and the negative smallest numbers, which no sensible answer meets: this saves over 1,000 tokens.
    """
    if isinstance(schema, list):
        return [_plain(item) for item in cast("list[Any]", schema)]
    if not isinstance(schema, dict):
        return schema
    fields = cast("dict[str, Any]", schema).items()
    names = {"title": str, "maximum": (int, float)}  # a property may have such a name; its value is a mapping
    plain = {key: _plain(value) for key, value in fields if not isinstance(value, names.get(key, ()))}
    if isinstance(plain.get("minimum"), (int, float)) and plain["minimum"] < 0.0:
        del plain["minimum"]
    if plain.get("default") in ([], ""):
        del plain["default"]
    items: list[Any] = plain.get("prefixItems", [])
    if items and all(item == items[0] for item in items):
        plain["items"] = plain.pop("prefixItems")[0]
    if "default" in plain and plain["default"] is None:
        del plain["default"]
        kinds = [kind for kind in plain.pop("anyOf") if kind != {"type": "null"}]
        plain |= kinds[0] if len(kinds) == 1 else {"anyOf": kinds}
    return plain


def _actuator_line(record: ActuatorRecord) -> str:
    stated = {name: getattr(record, name) for name in ("mass", "stall_torque", "rated_torque", "peak_torque", "price")}
    numbers = [f"{name.removesuffix('_torque')} {value:g}" for name, value in stated.items() if value is not None]
    return f"- {record.name} ({record.maker}): {', '.join(numbers)}"

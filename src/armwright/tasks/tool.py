"""The tool that an arm carries at the end of its last link."""

import math
from typing import Annotated, Any, cast

from pydantic import BaseModel, Field

from armwright.tasks.targets import Position
from armwright.yaml_documents import check_document

Angle = Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi)]  # [rad]


class Tool(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """A tool, in a frame at the end of the last link and parallel to the frame of that link.

    Attributes:
        tip: Position of the tip [m].
        rpy: Roll, pitch and yaw of the tip frame about the fixed x, then y, then z [rad].
    """

    tip: Position = (0.0, 0.0, 0.0)
    rpy: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)

    @property
    def length(self) -> float:
        """Distance from the end of the last link to the tip [m]."""
        return math.hypot(*self.tip)


NO_TOOL = Tool()


def read_tool(value: Any) -> Tool:
    """Return the tool of a record in a task file; raise ValueError if it is not one."""
    if not isinstance(value, dict):
        raise ValueError(f"tool: expected a record such as {{tip: [0, 0, 0.1]}}, got {value!r:.80}")
    return check_document(cast("dict[Any, Any]", value), Tool, ValueError, "tool")

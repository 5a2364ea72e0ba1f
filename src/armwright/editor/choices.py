"""The lists of the page: quantities, joint modules, actuators, materials."""

from typing import Any

from armwright.problem.objectives import OBJECTIVES, QUANTITIES
from armwright.robot.actuators import ActuatorRecord, catalogue
from armwright.robot.tubes import MATERIALS
from armwright.spaces.joint_modules import JOINT_DESCRIPTIONS
from armwright.tasks.points_file import UNITS


def choices() -> dict[str, Any]:
    """Return what a user can choose from, in JSON types."""
    return {
        "quantities": [
            {name: getattr(quantity, name) for name in ("name", "label", "unit", "description")}
            | {"is_objective": quantity.name in OBJECTIVES}
            for quantity in sorted(QUANTITIES.values(), key=lambda quantity: quantity.label)
        ],
        "modules": [
            {"letter": letter, "label": f"{letter}: {description.partition(',')[0]}", "description": description}
            for letter, description in JOINT_DESCRIPTIONS.items()
        ],
        "actuators": [_describe(record) for record in catalogue().values()],
        "materials": list(MATERIALS),
        "units": list(UNITS),
    }


def _describe(record: ActuatorRecord) -> dict[str, Any]:
    completed = record.completed()
    stated = {name: getattr(record, name) for name in ("name", "maker", "mass", "voltage", "price")}
    return stated | {"torque": completed.peak_torque or completed.rated_torque}

"""Masses and moments of inertia of rigid bodies in task files."""

from typing import Annotated

from pydantic import Field

MAX_MASS = 1e4  # [kg]
MAX_MOMENT = 1e6  # [kg m²]
ROUNDING = 1e-9  # relative

Mass = Annotated[float, Field(ge=0.0, le=MAX_MASS)]  # [kg]
Moment = Annotated[float, Field(ge=0.0, le=MAX_MOMENT)]  # [kg m²]
Moments = tuple[Moment, Moment, Moment]


def check_moments(moments: Moments) -> None:
    """Raise ValueError for moments of inertia [kg m²] that no rigid body has."""
    if 2.0 * max(moments) > (1.0 + ROUNDING) * sum(moments):
        raise ValueError(
            f"inertia = {list(moments)} kg m²: no body has these moments; each is at most the sum of the other two"
        )


def describe_vector(values: tuple[float, float, float]) -> str:
    """Return three numbers in brackets."""
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"

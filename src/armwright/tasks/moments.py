"""Masses and moments of inertia of rigid bodies in task files."""

from typing import Annotated

from pydantic import AfterValidator, Field

MAX_MASS = 1e4  # [kg]
MAX_MOMENT = 1e6  # [kg m²]
ROUNDING = 1e-9  # relative

Mass = Annotated[float, Field(ge=0.0, le=MAX_MASS)]  # [kg]
Moment = Annotated[float, Field(ge=0.0, le=MAX_MOMENT)]  # [kg m²]


def _check_moments(moments: tuple[float, float, float]) -> tuple[float, float, float]:
    if 2.0 * max(moments) > (1.0 + ROUNDING) * sum(moments):
        raise ValueError(f"no body has moments of {list(moments)} kg m²; each is at most the sum of the other two")
    return moments


Moments = Annotated[tuple[Moment, Moment, Moment], AfterValidator(_check_moments)]  # around x, y and z


def describe_vector(values: tuple[float, float, float]) -> str:
    """Return three numbers in brackets."""
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"

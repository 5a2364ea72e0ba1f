"""Types of the keys of a space file, with their checks."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar, cast

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer

T = TypeVar("T")


def _check_order(ends: tuple[Any, Any]) -> tuple[Any, Any]:
    low, high = ends
    if low > high:
        raise ValueError(f"[{low:g}, {high:g}] is reversed: give the smaller number first")
    return ends


def _check_distinct(choices: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(choices)) < len(choices):
        raise ValueError(f"expected different ones, got {', '.join(choices)}")
    return choices


def _one_to_list(value: Any) -> Any:
    return (value,) if isinstance(value, str) else value


def _mapping_to_pairs(value: Any) -> Any:
    return tuple(cast("Mapping[str, Any]", value).items()) if isinstance(value, dict) else value


Ordered = Annotated[tuple[T, T], AfterValidator(_check_order)]  # the smallest and the largest value
# One or several names; a file may state a single one without brackets
Choices = Annotated[tuple[T, ...], Field(min_length=1), BeforeValidator(_one_to_list), AfterValidator(_check_distinct)]
# Values by name, in the order of the file; a tuple, so that the space can be hashed
Pairs = Annotated[
    tuple[tuple[str, T], ...],
    Field(max_length=100),
    BeforeValidator(_mapping_to_pairs),
    PlainSerializer(dict, return_type=dict[str, Any]),
]

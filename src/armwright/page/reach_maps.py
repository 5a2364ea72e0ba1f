"""Reach maps of a run's designs, as the page shows them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import UNREADABLE, Array, open_arrays
from armwright.runs.folder import REACH_MAPS

MOST_POINTS = 20_000  # of a map; more would slow the page down
NOT_REACHED, IN_NO_DIRECTION, IN_ALL = 0, 1, 255  # levels of points; between the last two, the share of directions


@dataclass(frozen=True)
class PageReachMap:
    """A reach map for the page."""

    design: str  # `design_text` of its design; the numbers of designs may have changed since
    head: dict[str, Any]  # its grid and conditions
    levels: NDArray[np.uint8]  # (2, N) levels: within the joint limits, and also under the conditions


def read_reach_maps(run: Path, n: int, params: Callable[[int], Array]) -> dict[int, PageReachMap]:
    """Return the maps in the folder of a run of n designs, by design, without unreadable and outdated ones.

    `params` returns the (P,) parameters of a design; maps of other parameters are left out.
    """
    found: dict[int, PageReachMap] = {}
    for file in sorted((run / REACH_MAPS).glob("*.npz")):
        number = int(file.stem) if file.stem.isdecimal() else n
        shown = _read(file) if number < n else None
        if shown is not None and shown.design == design_text(params(number)):
            found[number] = shown
    return found


def design_text(params: Array) -> str:
    """Return the text by which a map names its design; params: (P,)."""
    return str(params.tolist())


def _read(file: Path) -> PageReachMap | None:
    """Return a map; None for a file that is damaged or too large to show."""
    try:
        with open_arrays(file) as arrays:
            points, spacing = np.asarray(arrays["points"], dtype=np.float64), float(arrays["spacing"])
            shape = [int(n) for n in arrays["shape"]]
            is_grid = len(shape) == 3 and min(shape) > 0 and points.shape == (math.prod(shape), 3)
            if (
                not is_grid
                or len(points) > MOST_POINTS
                or not (spacing > 0.0 and np.isfinite([*points[0], spacing]).all())
            ):
                return None
            levels = np.stack(
                [_levels(arrays[f"{use}covered"], arrays[f"{use}share"], len(points)) for use in ("", "usable_")]
            )
            design = str(arrays["design"])
            head: dict[str, Any] = {
                "shape": shape,
                "low": points[0].tolist(),
                "spacing": spacing,
                "directions": str(arrays["directions_text"]),
                "conditions": str(arrays["conditions"]),
            }
    except UNREADABLE:
        return None
    return PageReachMap(design, head, levels)


def _levels(covered: NDArray[Any], share: Array, n: int) -> NDArray[np.uint8]:
    """Return (N,) levels; IN_ALL stands for all directions, IN_NO_DIRECTION for none, and nothing else does."""
    if covered.shape != (n,) or share.shape != (n,) or not np.all((share >= 0.0) & (share <= 1.0)):
        raise ValueError("expected a share from 0 to 1 for each point")
    between = np.clip(np.ceil(IN_NO_DIRECTION + (IN_ALL - IN_NO_DIRECTION) * share), IN_NO_DIRECTION, IN_ALL - 1)
    levels = np.where(share == 1.0, IN_ALL, between)
    return np.where(covered.astype(bool), levels, NOT_REACHED).astype(np.uint8)

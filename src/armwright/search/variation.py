"""New designs from a pool of good ones."""

import numpy as np
from numpy.typing import NDArray

from armwright.search.columns import Array, Columns

NEIGHBOURS = 10  # places in the pool, to either side
DIFFERENCE_SHARE = 0.35  # of the batch: a difference of two neighbours is added
LINE_SHARE = 0.3  # of the batch: on the line to a neighbour, and somewhat beyond; the rest is a normal step
STEP_EXPONENTS = (-4.5, -1.0)  # of ten; normal steps are this long, as a share of a parameter's range
STEP_DENSITIES = (0.15, 0.3, 1.0)  # the share of parameters that a normal step changes
CATEGORY_SHARE = 0.3  # of the batch: categories change, too


def offspring(rows: Array, columns: Columns, n: int, rng: np.random.Generator) -> Array:
    """(n, P) new rows from a pool `rows` (N, P) whose neighbours resemble each other."""
    parents = rng.integers(len(rows), size=n)
    children = rows[parents]
    units = columns.units(rows)
    moved = _moved(units, parents, rng)
    children[:, columns.real] = columns.from_units(moved)
    children[:, columns.categorical] = _recategorised(children[:, columns.categorical], columns.choices, rng)
    return children


def _moved(units: Array, parents: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """(n, R) real parameters: three ways to step away from a parent, at random."""
    n, width = len(parents), units.shape[1]
    parent, first, second = units[parents], *(units[_neighbours(parents, len(units), rng)] for _ in range(2))
    by_difference = parent + rng.uniform(0.3, 1.0, (n, 1)) * (first - second)
    on_line = parent + rng.uniform(-0.25, 1.25, (n, width)) * (first - parent)
    lengths = 10.0 ** rng.uniform(*STEP_EXPONENTS, (n, 1))
    changes = rng.random((n, width)) < rng.choice(STEP_DENSITIES, (n, 1))
    by_step = parent + changes * lengths * rng.standard_normal((n, width))
    way = rng.random((n, 1))
    return np.where(
        way < DIFFERENCE_SHARE, by_difference, np.where(way < DIFFERENCE_SHARE + LINE_SHARE, on_line, by_step)
    )


def _neighbours(places: NDArray[np.int64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    return np.clip(places + rng.integers(-NEIGHBOURS, NEIGHBOURS + 1, len(places)), 0, n - 1)


def _recategorised(categories: Array, choices: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """(n, C) categories, of which one a row changes on average in a share of the rows."""
    n, width = categories.shape
    changes = (rng.random((n, 1)) < CATEGORY_SHARE) & (rng.random((n, width)) < 1.0 / max(width, 1))
    return np.where(changes, rng.integers(choices, size=(n, width)), categories)

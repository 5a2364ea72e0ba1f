"""New designs from a pool of good ones."""

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.search.encoding import Columns

RARE_SHARE = 0.3  # of the parents: of any structure in the pool alike, however few designs there are of it
MIXED_SHARE = 0.6  # of the batch: two members mixed, of any structure, as a base may be good for many of them
MIXED_SPREAD = 0.3  # of the distance between the two
NEIGHBOURS = 10  # places in the pool, to either side
DIFFERENCE_SHARE = 0.35  # of the others: a difference of two neighbours is added
LINE_SHARE = 0.3  # of the others: on the line to a neighbour, and somewhat beyond; the rest is a normal step
STEP_EXPONENTS = (-4.5, -1.0)  # of ten; normal steps are this long, as a share of a parameter's range
STEP_DENSITIES = (0.15, 0.3, 1.0)  # the share of parameters that a normal step changes
CATEGORY_SHARE = 0.3  # of the others: categories change, too


def offspring(rows: Array, columns: Columns, n: int, rng: np.random.Generator) -> Array:
    """(n, P) new rows from a pool `rows` (N, P) whose neighbours resemble each other."""
    parents = _parents(columns.structures(rows), n, rng)
    children, units = rows[parents], columns.units(rows)
    children[:, columns.real] = columns.from_units(_moved(units, parents, rng))
    children[:, columns.categorical] = _recategorised(children[:, columns.categorical], columns.choices, rng)
    return np.where(rng.random((n, 1)) < MIXED_SHARE, _mixed(rows, parents, columns, rng), children)


def _parents(structures: NDArray[np.int64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """(n,) places in a pool whose members have these structures (N,)."""
    _, structure, members = np.unique(structures, return_inverse=True, return_counts=True)
    rare = np.searchsorted(np.cumsum(1.0 / members[structure]), rng.random(n) * len(members), side="right")
    anywhere = rng.integers(len(structures), size=n)
    return np.where(rng.random(n) < RARE_SHARE, np.minimum(rare, len(structures) - 1), anywhere)


def _mixed(rows: Array, parents: NDArray[np.int64], columns: Columns, rng: np.random.Generator) -> Array:
    """(n, P) rows, each column the parent's or that of another member however far from it; real ones near it."""
    parent, other = rows[parents], rows[rng.integers(len(rows), size=len(parents))]
    children = np.where(rng.random(parent.shape) < 0.5, parent, other)
    apart = columns.units(other) - columns.units(parent)
    near = columns.units(children) + MIXED_SPREAD * rng.standard_normal(apart.shape) * apart
    children[:, columns.real] = columns.from_units(near)
    return children


def _moved(units: Array, parents: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """(n, R) real parameters: three ways to step away from a parent, at random."""
    n, width = len(parents), units.shape[1]
    parent, first, second = units[parents], *(units[_neighbours(parents, len(units), rng)] for _ in range(2))
    by_difference = parent + rng.uniform(0.3, 1.0, (n, 1)) * (first - second)
    on_line = parent + rng.uniform(-0.25, 1.25, (n, width)) * (first - parent)
    lengths = 10.0 ** rng.uniform(*STEP_EXPONENTS, (n, 1))
    changes = rng.random((n, width)) < rng.choice(STEP_DENSITIES, (n, 1))
    if width:
        changes[np.arange(n), rng.integers(width, size=n)] = True
    by_step = parent + changes * lengths * rng.standard_normal((n, width))
    way = rng.random((n, 1))
    return np.where(
        way < DIFFERENCE_SHARE, by_difference, np.where(way < DIFFERENCE_SHARE + LINE_SHARE, on_line, by_step)
    )


def _neighbours(places: NDArray[np.int64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    offsets = rng.integers(1, NEIGHBOURS + 1, len(places)) * rng.choice((-1, 1), len(places))
    return np.clip(places + offsets, 0, n - 1)


def _recategorised(categories: Array, choices: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """(n, C) categories, of which one a row changes on average in a share of the rows."""
    n, width = categories.shape
    changes = (rng.random((n, 1)) < CATEGORY_SHARE) & (rng.random((n, width)) < 1.0 / max(width, 1))
    return np.where(changes, rng.integers(choices, size=(n, width)), categories)

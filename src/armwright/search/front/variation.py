"""Variation operators of the front search: new designs from a pool of good ones."""

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.search.encoding import DesignEncoding

RARE_SHARE = 0.3  # of the parents: drawn with equal probability per structure, however few designs it has
NUMBER_SHARE = 0.3  # of the parents: chosen among designs with one number of joints, all numbers being equally likely
CROSSOVER_SHARE = 0.6  # of the batch: two members of any structure are mixed
CROSSOVER_SPREAD = 0.3  # of the distance between the two
NEIGHBOURS = 10  # pool members to either side
DIFFERENCE_SHARE = 0.35  # of the mutations: the difference of two neighbours is added
LINE_SHARE = 0.3  # of the mutations: on the line to a neighbour, or slightly beyond; the rest are normal steps
STEP_EXPONENTS = (-4.5, -1.0)  # of ten; length of normal steps, as a share of a parameter's range
STEP_DENSITIES = (0.15, 0.3, 1.0)  # share of parameters that a normal step changes
MARKED_SHARE = 0.2  # of these parameters: moved to an end or to the middle of their range instead
CATEGORY_SHARE = 0.3  # of the mutations: categories change, too


def offspring(
    pool: Array, ranks: NDArray[np.int64], encoding: DesignEncoding, n: int, rng: np.random.Generator
) -> Array:
    """Return an (n, P) matrix of new designs from a pool (N, P), sorted so that neighbours resemble each other.

    ranks: (N,) of the pool; of two designs that are drawn as a parent, the one with the lower rank is taken.
    """
    structures = encoding.structures(pool)
    one, other = _parents(structures, n, rng), _parents(structures, n, rng)
    numbers = encoding.n_joints(pool)
    if np.ptp(numbers):
        pairs = _of_equal_number(numbers, n, rng)
        one, other = np.where(rng.random(n) < NUMBER_SHARE, pairs, (one, other))
    parents = np.where(ranks[other] < ranks[one], other, one)
    children, units = pool[parents], encoding.units(pool)
    children[:, encoding.real] = encoding.from_units(_mutate_reals(units, parents, rng))
    children[:, encoding.categorical] = _mutate_categories(children[:, encoding.categorical], encoding.choices, rng)
    return np.where(rng.random((n, 1)) < CROSSOVER_SHARE, _cross(pool, parents, encoding, rng), children)


def _parents(structures: NDArray[np.int64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw (n,) indices of pool members, given the (N,) structures of the pool."""
    _, structure, members = np.unique(structures, return_inverse=True, return_counts=True)
    rare = np.searchsorted(np.cumsum(1.0 / members[structure]), rng.random(n) * len(members), side="right")
    uniform = rng.integers(len(structures), size=n)
    return np.where(rng.random(n) < RARE_SHARE, np.minimum(rare, len(structures) - 1), uniform)


def _of_equal_number(numbers: NDArray[np.int64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw (2, n) indices of pool members, pairs with as many joints, given the (N,) numbers of joints of the pool."""
    _, members = np.unique(numbers, return_counts=True)
    wanted = rng.integers(len(members), size=n)
    within = rng.integers(members[wanted], size=(2, n))
    return np.argsort(numbers, kind="stable")[(np.cumsum(members) - members)[wanted] + within]


def _cross(pool: Array, parents: NDArray[np.int64], encoding: DesignEncoding, rng: np.random.Generator) -> Array:
    """Mix each parent with another member, column by column; real columns vary around the chosen value.

    The other member may have any structure: a good base, for example, suits many of them.
    """
    parent, other = pool[parents], pool[rng.integers(len(pool), size=len(parents))]
    children = np.where(rng.random(parent.shape) < 0.5, parent, other)
    difference = encoding.units(other) - encoding.units(parent)
    units = encoding.units(children) + CROSSOVER_SPREAD * rng.standard_normal(difference.shape) * difference
    children[:, encoding.real] = encoding.from_units(units)
    return children


def _mutate_reals(units: Array, parents: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """Move each parent by one of three kinds of step, at random; (n, R)."""
    n, width = len(parents), units.shape[1]
    parent, first, second = units[parents], *(units[_neighbours(parents, len(units), rng)] for _ in range(2))
    by_difference = parent + rng.uniform(0.3, 1.0, (n, 1)) * (first - second)
    on_line = parent + rng.uniform(-0.25, 1.25, (n, width)) * (first - parent)
    lengths = 10.0 ** rng.uniform(*STEP_EXPONENTS, (n, 1))
    changes = rng.random((n, width)) < rng.choice(STEP_DENSITIES, (n, 1))
    if width:
        changes[np.arange(n), rng.integers(width, size=n)] = True
    by_step = parent + changes * lengths * rng.standard_normal((n, width))
    # Good arms often have the shortest first link, or a base in the plane of symmetry. Normal steps never end there.
    marked = changes & (rng.random((n, width)) < MARKED_SHARE)
    by_step = np.where(marked, rng.choice((0.0, 0.5, 1.0), (n, width)), by_step)
    kind = rng.random((n, 1))
    return np.where(
        kind < DIFFERENCE_SHARE, by_difference, np.where(kind < DIFFERENCE_SHARE + LINE_SHARE, on_line, by_step)
    )


def _neighbours(members: NDArray[np.int64], n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    offsets = rng.integers(1, NEIGHBOURS + 1, len(members)) * rng.choice((-1, 1), len(members))
    return np.clip(members + offsets, 0, n - 1)


def _mutate_categories(categories: Array, choices: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """Change on average one category in each of a share of the designs; (n, C)."""
    n, width = categories.shape
    changes = (rng.random((n, 1)) < CATEGORY_SHARE) & (rng.random((n, width)) < 1.0 / max(width, 1))
    return np.where(changes, rng.integers(choices, size=(n, width)), categories)

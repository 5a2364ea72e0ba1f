"""Constrained domination of designs: arrays in, arrays out.

A constraint's value is how far it is broken; everything is minimised and feasible is <= 0. Deb's rules (Deb et al., A
fast and elitist multiobjective genetic algorithm: NSGA-II, IEEE Trans. Evol. Comput. 6(2), 2002): a feasible design is
better than any that is not, of two infeasible ones that of less violation, of two feasible ones the objectives decide.
"""

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

FAR = 1e100  # beyond any value of an objective


def feasible_mask(broken: Array) -> NDArray[np.bool_]:
    """(N,) whether designs meet all constraints; broken: (N, C)."""
    return np.all(broken <= 0.0, axis=1)


def violation(broken: Array) -> Array:
    """(N,) how far designs break their constraints, summed; 0 for feasible ones. broken: (N, C)."""
    return np.maximum(broken, 0.0).sum(axis=1)


def counted(values: Array, broken: Array) -> Array:
    """(N, M) the objectives, infinite for infeasible designs: these are on no front and have no hypervolume."""
    feasible = feasible_mask(broken)
    return values if feasible.all() else np.where(feasible[:, None], values, np.inf)


def ranked(values: Array, broken: Array) -> Array:
    """(N, M) numbers whose plain domination is the constrained domination of values (N, M) and broken (N, C).

    Those of a feasible design are its values; those of any other lie behind all feasible ones', by its violation.
    """
    far = FAR * (1.0 + violation(broken))
    return np.where(feasible_mask(broken)[:, None], values, far[:, None])

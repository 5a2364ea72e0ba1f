"""Instants of a motion at which its loads are evaluated, and the means over time that they give."""

from dataclasses import dataclass

import numpy as np

INSTANTS = 33  # of a path
FEW_INSTANTS = 5  # of an estimate


@dataclass(frozen=True)
class Instants:
    """F instants of a motion."""

    time: tuple[float, ...]  # as shares of its duration
    weight: tuple[float, ...]  # of each in a mean over the motion

    def __len__(self) -> int:
        return len(self.time)

    def times(self, density: int) -> "Instants":
        """Return `density` times as many of equal instants."""
        return self if density == 1 else equal_instants(density * (len(self) - 1) + 1)


def equal_instants(n: int) -> Instants:
    """Return n equally spaced instants, ends included, with the weights of the trapezoidal rule."""
    weight = np.full(n, 1.0 / (n - 1))
    weight[[0, -1]] /= 2.0
    return Instants(tuple(np.linspace(0.0, 1.0, n).tolist()), tuple(weight.tolist()))


def _gauss_instants(n: int) -> Instants:
    """Return the n instants and weights of Gauss and Legendre.

    Five are exact for polynomials of degree 9, so for the mean square of the accelerations of a motion (degree 6), of
    which equal ones would miss 8 %.
    """
    node, weight = np.polynomial.legendre.leggauss(n)
    return Instants(tuple((0.5 + 0.5 * node).tolist()), tuple((0.5 * weight).tolist()))


EQUAL, FEW = equal_instants(INSTANTS), _gauss_instants(FEW_INSTANTS)

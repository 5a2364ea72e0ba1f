"""Instants of a motion at which its loads are evaluated, and the means over time that they give."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

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


@dataclass(frozen=True)
class Picks:
    """P samples of M motions between which the loads at F instants of each are interpolated, one motion after another.

    A motion that goes back has the samples of its source, at mirrored instants.
    """

    sample: NDArray[np.intp]  # (P,) index of each among all samples of all motions
    motion_of: NDArray[np.intp]  # (P,)
    start: NDArray[np.intp]  # (M,) index of the first of a motion's own samples, or of its source's
    low: NDArray[np.intp]  # (M, F) index of the sample before each instant, counted from the first
    high: NDArray[np.intp]  # (M, F) likewise of the one behind
    share: Array  # (M, F) of the way from there
    rate: Array  # (F,) s_τ
    change: Array  # (F,) s_ττ
    way: Array  # (M,) -1 for motions that go back along their source, else 1
    first: NDArray[np.intp]  # (M,) index of the sample at which a motion begins, counted from the first
    last: NDArray[np.intp]  # (M,) and ends


@cache
def picks(counts: tuple[int, ...], source: tuple[int, ...], instants: Instants) -> Picks:
    """Return the samples that instants need, of motions with so many, equal in s; source: as of `CyclePlan`."""
    s, rate, change = quintic(np.array(instants.time))
    own = [index for index, other in enumerate(source) if index == other]
    begin = np.cumsum([0, *counts[:-1]])
    wanted: dict[int, NDArray[np.intp]] = {}
    for index in own:
        n = counts[index] - 1
        before = np.minimum((s * n).astype(np.intp), n - 1)
        of_motion = np.concatenate([before, before + 1, [0, n]])
        wanted[index] = np.unique(np.concatenate([of_motion, n - of_motion]))
    sizes = [len(wanted[index]) for index in own]
    start = dict(zip(own, np.cumsum([0, *sizes[:-1]]).tolist(), strict=True))
    low, high = np.empty((2, len(source), len(s)), dtype=np.intp)
    share = np.empty(low.shape)
    for index, other in enumerate(source):
        n = counts[index] - 1
        before = np.minimum((s * n).astype(np.intp), n - 1)
        ends = (before, before + 1) if index == other else (n - before, n - before - 1)
        low[index], high[index] = (np.searchsorted(wanted[other], end) for end in ends)
        share[index] = s * n - before
    way = np.array([1.0 if index == other else -1.0 for index, other in enumerate(source)])
    final = np.array([len(wanted[other]) - 1 for other in source])
    sample = np.concatenate([begin[index] + wanted[index] for index in own])
    begins = np.array([start[other] for other in source])
    first, last = np.where(way > 0.0, 0, final), np.where(way > 0.0, final, 0)
    return Picks(sample, np.repeat(own, sizes), begins, low, high, share, rate, change, way, first, last)


def quintic(t: Array) -> tuple[Array, Array, Array]:
    """Return s, s_τ and s_ττ of the profile at shares of the duration."""
    s = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    return s, 30.0 * t**2 * (1.0 - t) ** 2, 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t)

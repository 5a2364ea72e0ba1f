"""The joint path of arms along one motion: a cubic spline through samples of a line, a straight line in joint space."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from armwright.arrays import Array
from armwright.tasks.motions import Motion

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

MANY_SAMPLES = 256  # beyond which the weights of all samples take more time and memory than they save


@dataclass(frozen=True)
class MotionPath:
    """N arms along a motion."""

    motion: Motion  # the motion
    q: Array  # (N, R + 1, D) joint values at equal shares s of the motion from 0 to 1 [rad] or [m]

    @property
    def share(self) -> Array:
        """(R + 1,) the shares of the samples."""
        return np.linspace(0.0, 1.0, self.q.shape[1])

    def at(self, share: Array, order: int = 0) -> Array:
        """Return (N, F, D) joint values at shares (F,), or their first or second derivatives by the share."""
        if self.motion.by == "joint":
            change = self.q[:, -1:] - self.q[:, :1]
            weight = (share, np.ones(len(share)), np.zeros(len(share)))[order]
            return (self.q[:, :1] if order == 0 else 0.0) + weight[:, None] * change
        if self.q.shape[1] > MANY_SAMPLES:
            return _spline(self.share, self.q, axis=1)(share, order)
        weights = _spline_weights(self.q.shape[1], tuple(share.tolist()), order)
        return np.matmul(weights, self.q)

    @property
    def largest_steps(self) -> Array:
        """(N, D) largest change of each joint from one sample to the next [rad] or [m]."""
        return np.abs(np.diff(self.q, axis=1)).max(axis=1)


@lru_cache(maxsize=128)
def _spline_weights(samples: int, share: tuple[float, ...], order: int) -> Array:
    """Return (F, R) weights of equally spaced samples in the values of their spline, or its derivatives."""
    spline = _spline(np.linspace(0.0, 1.0, samples), np.eye(samples))
    return np.ascontiguousarray(spline(np.array(share), order))


def _spline(share: Array, q: Array, axis: int = 0) -> "CubicSpline":
    """Return the cubic spline through q at shares along an axis."""
    from scipy.interpolate import CubicSpline  # takes 0.4 s to import, which searches without a cycle save

    return CubicSpline(share, q, axis=axis)

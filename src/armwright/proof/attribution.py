"""Attribution: the hypervolume and the front of a history by the source of the trials."""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.pareto import front_mask
from armwright.runs.history import History
from armwright.runs.trial import Count


@dataclass(frozen=True)
class Attribution:
    """The contribution of the trials of one source."""

    trials: Count  # number of trials
    front: Count  # number of trials on the final front
    hypervolume_gained: float | None  # sum of `hypervolume_gains`; None without a reference point


def attribution_by_source(history: History) -> dict[str, Attribution]:
    """Return the attribution of each source, in the order of their first trials."""
    gains, on_front = hypervolume_gains(history), front_mask(history.masked_objectives)
    attribution: dict[str, Attribution] = {}
    sources = np.array([trial.source for trial in history], dtype=object)
    for source in dict.fromkeys(sources.tolist()):
        mine = sources == source
        gained = None if gains is None else float(gains[mine].sum())
        attribution[source] = Attribution(int(mine.sum()), int(on_front[mine].sum()), gained)
    return attribution


def hypervolume_gains(history: History) -> Array | None:
    """Return (N,) the hypervolume that each trial, random ones included, added when it finished.

    The sum is the final hypervolume. A trial is not charged for what later trials cannot add because of it. The result
    is None without a reference point.
    """
    if history.reference_point is None:
        return None
    return np.diff(history.hypervolumes, prepend=0.0)

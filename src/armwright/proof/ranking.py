"""The order in which designs of a front are chosen."""

import math
from collections.abc import Sequence

import numpy as np

from armwright.pareto import knee_index
from armwright.runs.history import FrontMember, History


def knee_first(history: History, members: Sequence[FrontMember]) -> list[FrontMember]:
    """Return designs of a front: their knee, if they have one, then those nearest to the corner of the front."""
    n_objectives = len(history.problem.objectives)
    scale = np.array(history.reference_point or np.ones(n_objectives))
    reference = history.reference_point or (math.inf,) * n_objectives
    knee = knee_index(np.array([member.values for member in members]), reference) if members else None
    first = [] if knee is None else [members[knee]]
    others = [member for member in members if member not in first]
    return first + sorted(others, key=lambda member: float(np.linalg.norm(np.array(member.values) / scale)))

"""Clearance along spans of paths against that of all their samples."""

from dataclasses import replace

import numpy as np
import pytest

from armwright.kinematics.arms.arm_arrays import Precision, stack_arms, stack_columns
from armwright.kinematics.contact.clearance import clearances, path_clearances
from armwright.spaces.tool_mount import with_tool
from armwright.tasks.obstacles import Ground
from armwright.tasks.tip_rules import APART, TipRules, tip_solids
from tests.kinematics.test_clearance import random_obstacle
from tests.kinematics.test_motor_bodies import postures
from tests.kinematics.test_tip_bodies import LOAD, SPACE, TOOLS

SAMPLES = 25  # of each of the motions between random postures


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("most", [np.inf, 0.05, 0.0])
def test_clearance_of_spans_is_the_least_of_their_samples(precision: Precision, most: float) -> None:
    arms = [with_tool(SPACE.arm(design), TOOLS[n % 2]) for n, design in enumerate(SPACE.sample(30, 5))]
    rng = np.random.default_rng(6)
    arrays = stack_arms(arms, precision)
    columns = stack_columns(0.08, rng.choice([0.0, 0.3], len(arms)), precision)
    arrays = replace(arrays, columns=columns, radius=arrays.radius * rng.uniform(0.3, 2.0, (len(arms), 1)))
    obstacles = [random_obstacle(rng, kind, 1.2, 0.5) for kind in ("box", "sphere", "cylinder", "mesh")]
    obstacles.append(Ground(kind="ground", z=-0.6))
    ends = postures(arms, 7, 7)
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None] ** rng.choice([1.0, 3.0])
    ends[:, 1::3] = ends[:, :-1:3] + 0.05 * (ends[:, 1::3] - ends[:, :-1:3])  # slow motions
    q = (ends[:, :-1, None] + share * np.diff(ends, axis=1)[:, :, None]).reshape(len(arms), -1, arrays.dof)
    t = 6 * SAMPLES
    first = np.array([0, *np.sort(rng.choice(np.arange(1, t), 9, replace=False)), t])
    allowed = rng.choice([APART, 0.0, 0.02, np.inf], (t, 5), p=[0.6, 0.2, 0.1, 0.1])
    rules = TipRules(rng.random(t) < 0.7, allowed, tip_solids(TOOLS[0], LOAD))
    omitted = rng.random((len(arms), 10)) < 0.1
    found, samples = path_clearances(arrays, q, first, obstacles, rules=rules, most=most, omitted=omitted)
    for loaded in (0, 1):
        carries = rules.carries & bool(loaded)
        each = np.stack(clearances(arrays, q, obstacles, rules=replace(rules, carries=carries), most=most))
        wanted = np.where(omitted, most, np.minimum.reduceat(each, first[:-1], axis=2))
        assert np.isfinite(wanted[:, ~omitted]).all()
        # Bounds exclude pairs, which the search for nearest points finds up to 1e-5 m nearer than they are.
        assert found[:, loaded] == pytest.approx(wanted, abs=1e-5)
        assert np.mean(found[:, loaded] == wanted) > 0.9
        least = np.take_along_axis(each.min(axis=0), samples[loaded], axis=1)
        assert least[~omitted] == pytest.approx(wanted.min(axis=0)[~omitted], abs=1e-5)
        assert ((samples[loaded] >= first[:-1]) & (samples[loaded] < first[1:])).all()
    assert (found[:, 1] < found[:, 0]).any() or most == 0.0

"""How fast targets with an axis or an orientation are solved on one core, beside points.

Random arms of 6 and 7 joints at 8 targets, 100 updates from the straight start each; designs per second of processor
time, which other programs on the machine hardly change, the best of five rounds. Last, how long each variant of the
kernels takes to compile, with an empty cache.

    python benchmarks/poses.py
"""

import os
import sys
import tempfile
import time
from dataclasses import replace

import numpy as np

ARMS, TARGETS = 4000, 8


def main() -> None:
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])  # before any thread begins
    os.environ["WARP_CACHE_PATH"] = tempfile.mkdtemp(prefix="armwright-poses-")  # where nothing is compiled yet
    from armwright.kinematics.devices import load
    from armwright.kinematics.ik import LANES, solve_postures
    from armwright.rotations import rotation_from_rpy
    from armwright.spaces.batch_builder import stack_designs
    from armwright.spaces.design_space import paper_space
    from armwright.tasks.targets import AXIS, ORIENTATION, position_targets

    compiled = {}
    for rows in ("position", "pose"):
        began = time.process_time()
        load("float32", LANES["cpu"], "revolute", rows, "cpu")
        compiled[rows] = time.process_time() - began
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (TARGETS, 3))
    rotation = np.array([rotation_from_rpy(*angles) for angles in rng.uniform(-np.pi, np.pi, (TARGETS, 3))])
    print(f"designs/s on one core, {TARGETS} targets, 100 updates")
    for joints in (6, 7):
        space = paper_space(joints)
        arms = stack_designs(space, space.matrix(space.sample(ARMS, seed=0)))
        kinds = ([0] * 8, [AXIS] * 8, [ORIENTATION] * 8, [0, AXIS, ORIENTATION, AXIS] * 2)
        best = np.full(len(kinds), np.inf)
        for _ in range(5):
            for i, rows in enumerate(kinds):
                target_arrays = replace(position_targets(TARGETS), n_angular=np.array(rows), rotation=rotation)
                began = time.process_time()
                solve_postures(arms, points, target_arrays=target_arrays)
                best[i] = min(best[i], time.process_time() - began)
        points_, axes, orientations, mixed = ARMS / best
        print(
            f"  D = {joints}: points {points_:8.0f}, axes {axes:8.0f} ({axes / points_:.2f} of that), "
            f"orientations {orientations:8.0f}, of all kinds {mixed:8.0f}"
        )
        sys.stdout.flush()
    print("compiled in " + ", ".join(f"{seconds:.1f} s ({rows})" for rows, seconds in compiled.items()))


if __name__ == "__main__":
    main()

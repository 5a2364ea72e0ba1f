"""How long reach maps take, and how many reachable poses they miss.

Arms of test packages and one random arm, about 2,000 points with 50 directions each. Seconds of processor time on one
core, which other programs on the machine hardly change, without the compilation of kernels.
Missed: of 1,000 poses drawn from the grid, those not found among those that 60 random restarts of `aw.solve` find.

    python benchmarks/reach_map.py
"""

import os
import time

import numpy as np

POSES, RESTARTS = 1000, 60


def main() -> None:
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])  # before any thread begins
    import armwright as aw
    from tests.support.arms import paper_arms
    from tests.support.robots import robot

    arms: dict[str, aw.UrdfArm | aw.Arm] = {name: aw.read_urdf(robot(name)) for name in ("ur5_robot", "panda")}
    arms["random, 6 joints"] = paper_arms(1, 6, 3)[0]
    for name, arm in arms.items():
        aw.reach_map(arm, spacing=0.5)  # compiles what is not compiled yet
        began = time.process_time()
        found = aw.reach_map(arm)
        seconds = time.process_time() - began
        reached = found.bare.reached
        chosen = np.random.default_rng(0).choice(reached.size, POSES, replace=False)
        point, direction = np.unravel_index(chosen, reached.shape)
        peer = aw.solve(arm, found.points[point], axes=found.directions[direction], restarts=RESTARTS).reached[0]
        missed = float((peer & ~reached[point, direction]).sum() / peer.sum())
        print(
            f"{name:18} {reached.size:8,} poses in {seconds:5.2f} s of one core, {reached.mean():6.1%} reached, "
            f"{missed:.1%} missed",
            flush=True,
        )


if __name__ == "__main__":
    main()

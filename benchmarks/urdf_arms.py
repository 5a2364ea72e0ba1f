"""Compare arms from URDF files with Pinocchio's reading of the same files.

    python benchmarks/urdf_arms.py FOLDER [TIP ...]

reads every URDF in a folder, and of robots with several arms the one that ends at one of the TIPs. Of each it prints
the largest differences of the tip, the torques that hold it, the torques that move it and the mass matrix in 50 random
states, relative to the largest value of the arm, in float64 and in float32.
"""

import sys
from pathlib import Path

from armwright.exceptions import ArmError
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from tests.support.urdf_peers import differences, random_states, seen_by_kernels, seen_by_pinocchio

STATES = 50


def main(folder: Path, tips: list[str]) -> None:
    """Print a table of the arms, and the files that are not read with the reason."""
    refused: list[str] = []
    print("| file | joints | precision | tip | gravity | RNEA | mass matrix |\n|---|--:|---|--:|--:|--:|--:|")
    for path in sorted(folder.rglob("*.urdf")):
        try:
            print_row(path, read(path, tips))
        except ArmError as fault:
            refused.append(str(fault).replace(str(path), path.stem))
    print("\nNot read:\n\n" + "\n".join(f"- {reason}" for reason in refused))


def read(path: Path, tips: list[str]) -> UrdfArm:
    """Read an arm with the default tip, else with the first of the given tips that it has."""
    faults: list[ArmError] = []
    for tip in (None, *tips):
        try:
            return read_urdf(path, tip)
        except ArmError as fault:
            faults.append(fault)
    raise faults[0]


def print_row(path: Path, read: UrdfArm) -> None:
    """Print the differences of an arm in both precisions."""
    states = random_states(read.arm, STATES, 0)
    theirs = seen_by_pinocchio(path, read, states)
    for precision in ("float64", "float32"):
        off = differences(seen_by_kernels(read.arm, states, precision=precision), theirs)
        worst = [max(off["tip"], off["rotation"]), off["gravity"], off["torque"], off["inertia"]]
        values = " | ".join(f"{value:.0e}" for value in worst)
        print(f"| {path.stem} | {len(read.joints)} | {precision} | {values} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])

"""Compare arms from URDF files with Pinocchio's reading of the same files.

    python benchmarks/urdf_arms.py FOLDER

reads every URDF in a folder: the arm that `read_urdf` chooses, or, of a robot with several, all chains from the root to
an end. It prints the largest differences of the tip frame, the torques at rest, the torques in motion (RNEA) and the
mass matrix in 50 random states, relative to the largest value of the chain, in float64 and in float32.
"""

import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from armwright.exceptions import ArmError
from armwright.kinematics.arms.arm_arrays import MAX_JOINTS
from armwright.robot.urdf_reader import UrdfArm, read_urdf
from armwright.robot.urdf_xml import read_document
from tests.support.urdf_peers import differences, random_states, seen_by_kernels, seen_by_pinocchio

STATES = 50
FEWEST = 3  # joints of a chain of a robot with several, such as wheels


def main(folder: Path) -> None:
    """Print a table of the arms, and the files that are not read with the reason."""
    refused: list[str] = []
    print("| file | chains | joints | tip | gravity | RNEA | mass matrix | largest in float32 |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    for path in sorted(folder.rglob("*.urdf"), key=lambda path: path.stem):
        try:
            arms = chains(path)
            rows = np.array([worst(path, arm) for arm in arms]).max(axis=0)
        except (ArmError, ValueError) as fault:
            refused.append(str(fault).replace(str(path), path.stem))
            continue
        joints = sorted({len(arm.joints) for arm in arms})
        size = f"{joints[0]} to {joints[-1]}" if len(joints) > 1 else f"{joints[0]}"
        print(f"| {path.stem} | {len(arms)} | {size} | {' | '.join(f'{value:.0e}' for value in rows)} |")
    print("\nNot read:\n\n" + "\n".join(f"- {reason}" for reason in refused))


def chains(path: Path) -> list[UrdfArm]:
    """Read the arm of a file, or, of a robot with several, each that ends at a link without children."""
    try:
        return [read_urdf(path)]
    except ArmError:
        document, found = read_document(path), list[UrdfArm]()
        for tip in document.links.keys() - {joint.parent for joint in document.joints}:
            with suppress(ArmError):
                found.append(read_urdf(path, tip))
        found = [arm for arm in found if FEWEST <= len(arm.joints) <= MAX_JOINTS]
        if not found:
            raise
        return found


def worst(path: Path, read: UrdfArm) -> list[float]:
    """Return the differences of tip, torques at rest and in motion, and mass matrix, and the largest in float32."""
    states = random_states(read.arm, STATES, 0)
    theirs = seen_by_pinocchio(path, read, states)
    off = differences(seen_by_kernels(read.arm, states), theirs)
    single = differences(seen_by_kernels(read.arm, states, precision="float32"), theirs)
    return [max(off["tip"], off["rotation"]), off["gravity"], off["torque"], off["inertia"], max(single.values())]


if __name__ == "__main__":
    main(Path(sys.argv[1]))

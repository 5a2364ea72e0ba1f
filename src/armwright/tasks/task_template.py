"""A commented task file to edit."""

import json
import re
import shlex
from pathlib import Path

from armwright.files import check_name
from armwright.tasks.targets import Point


def task_template(file: Path, targets: tuple[Point, ...] | None = None) -> str:
    """Return a commented task file to edit, with `targets` [m] or three example points."""
    points = targets or ((0.45, 0.0, 0.1), (0.45, 0.2, 0.3), (0.45, -0.2, 0.3))
    rows = "\n".join(f"  - [{x!r}, {y!r}, {z!r}]" for x, y, z in points)
    return f"""\
# A task for armwright: points that the tip of the arm should reach.
# Run it with:  armwright optimize {shlex.quote(str(file))}
name: {json.dumps(_safe_name(file.stem))}    # names the run folder: letters, digits, . _ -

# x, y, z in metres; z is up. The base is searched within ±1 m of the origin (see --space).
targets:
{rows}

# A target can say more than its point: which way the tool's own z points there (axis), or its whole orientation as
# roll, pitch, yaw about the fixed x, y, z [rad]; from where on it counts as missed; how much it counts.
#   - {{position: [0.45, 0.0, 0.1], axis: [0, 0, -1], tolerance: 0.002, angle_tolerance: 0.05, weight: 2}}
#   - {{position: [0.45, 0.2, 0.3], orientation: [3.1416, 0, 1.5708]}}

# Further starts of the inverse kinematics at each target, from postures drawn at random; the best posture counts.
# restarts: 3

# What the tip carries: at every target, or a list with a value for each [kg].
# payload: 0.5

# The worst case counts, in each objective, of these payloads (0: empty-handed; 1.2: a fifth more), and of targets that
# are all off by so many metres along x, y or z.
# payload_factors: [0.0, 1.2]
# target_noise: 0.005

# What the arm should keep away from, in metres; it counts with the objective collision or clearance_shortfall.
# obstacles:
#   - {{kind: ground, z: 0.0}}
#   - {{kind: box, name: shelf, center: [0.4, 0.0, 0.2], size: [0.3, 0.6, 0.02], yaw: 0.0}}
#   - {{kind: sphere, center: [0.0, 0.4, 0.3], radius: 0.1}}
#   - {{kind: cylinder, center: [0.2, 0.3, 0.5], radius: 0.03, height: 1.0, axis: z}}

# Straight lines that the tip goes along: from each target to the next, or pairs of targets counted from 1. They count
# in path_error, max_joint_step, peak_torque, torque_utilisation, collision and clearance_shortfall.
# moves: in_order    # or [[1, 2], [2, 1]]
# move_step: 0.02    # m between two samples of a line
# move_time: 1.5     # s, or a list with a value for each; for dynamic_torque, dynamic_utilisation, speed_utilisation

# A box that the tip should cover, in metres, or a list of boxes; it counts with the objective uncovered_fraction. Where
# targets are left out, they are its corners.
# workspace: {{low: [0.2, -0.3, 0.0], high: [0.6, 0.3, 0.4], points: 200}}

# What is minimised; without it, the paper's two, position_error and torque. Also: worst_error, unreached_targets,
# peak_torque, rms_torque, mass, length, collision, clearance_shortfall, orientation_error, worst_angle, path_error,
# max_joint_step, dynamic_torque, uncovered_fraction, anisotropy.
# objectives: [worst_error, peak_torque, mass]

# What a design has to keep; one that does not is on no front. Any of the objectives' names, <= or >=, and a number
# in its unit.
# constraints:
#   - worst_error <= 0.01
#   - mass <= 3

# Worst values that still count, for the hypervolume: [position error summed over the targets in m,
# torque summed over the targets in N m, times 40], or one for each of the objectives. Without it, 1.1 x the worst
# non-dominated values of the first random trials is taken and kept for the run.
# reference_point: [5.0, 5.0]

# description: What the arm has to do there.
# provenance: Who measured the points, and when.
"""


def _safe_name(stem: str) -> str:
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip("._-")[:64].rstrip(".") or "task"
    try:
        return check_name(name)
    except ValueError:
        return f"task-{name}"

"""An evaluator of your own: each arm is simulated in MuJoCo on its way along the targets.

    pip install "armwright[studies]"
    armwright optimize target-1 --evaluator examples/mujoco_simulation.py:follow --n-total 50

or, in two processes (on other machines, with --scheduler tcp://HOST:PORT of a Dask cluster):

    armwright optimize target-1 --evaluator examples/mujoco_simulation.py:follow --workers 2

Motors hold the joints by a PD law with limited torque. The arm begins straight and has a second for each target; what
counts is how far its tip is from the target then, summed, and the work that its motors did.
"""

import mujoco
import numpy as np

import armwright as aw

STIFFNESS, DAMPING = 2.0, 0.05  # [N m/rad], [N m s/rad]; the paper's arms weigh some ten grams
MAX_TORQUE = 0.5  # [N m]
SECONDS = 1.0  # for each target


@aw.evaluator("distance [m]", "work [J]")
def follow(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Simulate the arm at its targets; return its total distance from them and the work of its motors."""
    model = mujoco.MjModel.from_xml_string(aw.to_mjcf(arm))
    model.opt.timestep = 0.002
    model.dof_armature[:] = 1e-4  # [kg m²] of the rotors, without which joints of so light arms are stiff to compute
    data = mujoco.MjData(model)
    tip = model.site("tip").id
    postures = aw.evaluate(arm, task).q[0, :, : model.nq]  # (T, D) [rad], by our inverse kinematics
    distance = work = 0.0
    for target, posture in zip(task.target_positions, postures, strict=True):
        for _ in range(round(SECONDS / model.opt.timestep)):
            torque = STIFFNESS * (posture - data.qpos) - DAMPING * data.qvel
            data.qfrc_applied[:] = np.clip(torque, -MAX_TORQUE, MAX_TORQUE)
            work += float(np.abs(data.qfrc_applied * data.qvel).sum()) * model.opt.timestep
            mujoco.mj_step(model, data)
        distance += float(np.linalg.norm(data.site_xpos[tip] - target))
    return distance, work

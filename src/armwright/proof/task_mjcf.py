"""`aw.to_mjcf`: an arm as MJCF, alone or in a task."""

import numpy as np

from armwright.exceptions import SettingsError
from armwright.problem.evaluation import evaluate
from armwright.proof.cycle_export import modelled
from armwright.proof.simulation_model import to_simulation_mjcf
from armwright.robot import mjcf
from armwright.robot.arm import Arm
from armwright.spaces.tool_mount import carrying_tool
from armwright.tasks.task import Task


def to_mjcf(arm: Arm, task: Task | None = None, *, name: str = "arm") -> str:
    """Return the MJCF of an arm.

    The arm alone has bodies base, link_1 on joint_1, …, a site `tip`, and motors motor_1 on joint_1, …, whose `ctrl` is
    the torque [N m] or force [N] on that joint. Its geometry is for display only.

    With a task, the model is that of `armwright simulate`: the task's tool on an arm that carries none, the payload as
    a body `payload` at the tip, obstacles, links that touch, a site target_NAME and a keyframe NAME for each target,
    and for each moving joint a position actuator servo_1, … and a torque actuator ff_1, …. If the task has a cycle, the
    keyframes are its postures. The payload is held from the start.

    Args:
        arm: The arm.
        task: What the arm works on; None for the arm alone.
        name: Name of the model.

    Examples:
        >>> import armwright as aw
        >>> space = aw.paper_space()
        >>> arm = space.arm(space.sample(1, seed=0)[0])
        >>> "motor_1" in aw.to_mjcf(arm), "target_1" in aw.to_mjcf(arm, aw.load_task("target-1"))
        (True, True)
    """
    if task is None:
        return mjcf.to_mjcf(arm, name)
    equipped = carrying_tool(arm, task.tool)
    evaluation = evaluate(equipped, task)
    try:
        return modelled(equipped, task.target_names, evaluation, 0, name).mjcf
    except SettingsError:  # no cycle, or a step of unknown duration
        moving = [joint.kind != "fixed" for joint in equipped.joints]
        peaks = np.abs(evaluation.joint_torques[0][:, moving]).max(axis=0)
        return to_simulation_mjcf(equipped, evaluation, task.target_names, evaluation.q[0], peaks, name)

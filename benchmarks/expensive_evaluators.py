"""Evaluators of `expensive.py`: short simulations in MuJoCo, and a control that knows nothing of physics."""

from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

import armwright as aw
from armwright.arrays import Array

STIFFNESS, DAMPING = 2.0, 0.05  # [N m/rad], [N m s/rad], as in examples/mujoco_simulation.py
MAX_TORQUE = 0.5  # [N m]
ARMATURE = 1e-4  # [kg m²]
TIMESTEP = 0.004  # [s]; the example takes 0.002
SECONDS = 0.4  # [s] for each target; the example takes 1
SETTLED = 0.03  # [m] from where the tip ends
N_WAVES = 40  # of the control
AXES = "xyz"


class Simulation:
    """An arm whose motors hold its joints by a PD law; implicit damping allows long steps."""

    def __init__(self, arm: aw.Arm) -> None:
        self.model: Any = mujoco.MjModel.from_xml_string(aw.to_mjcf(arm))  # pyright: ignore
        self.model.opt.timestep = TIMESTEP
        self.model.dof_armature[:] = ARMATURE
        self.model.dof_damping[:] = DAMPING
        self.data: Any = mujoco.MjData(self.model)  # pyright: ignore
        self._tip: int = self.model.site("tip").id

    def move(self, posture: Array) -> tuple[Array, float]:
        """Hold the joints at a posture; return (S, 3) positions of the tip [m] and the work of the motors [J]."""
        model, data = self.model, self.data
        tips, work = np.empty((round(SECONDS / TIMESTEP), 3)), 0.0
        for row in range(len(tips)):
            torque = np.clip(STIFFNESS * (posture - data.qpos), -MAX_TORQUE, MAX_TORQUE)
            data.qfrc_applied[:] = torque
            work += float(np.abs((torque - DAMPING * data.qvel) * data.qvel).sum()) * TIMESTEP
            mujoco.mj_step(model, data)  # pyright: ignore
            tips[row] = data.site_xpos[self._tip]
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:  # pyright: ignore
            raise ArithmeticError("the simulation diverged")
        return tips, work


@aw.evaluator("distance [m]", "work [J]")
def pd(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Simulate the arm at its targets; return its total distance from them and the work of its motors."""
    simulation, distance, work = Simulation(arm), 0.0, 0.0
    postures = aw.evaluate(arm, task).q[0, :, : simulation.model.nq]  # (T, D) [rad]
    for target, posture in zip(task.target_positions, postures, strict=True):
        tips, spent = simulation.move(posture)
        distance, work = distance + float(np.linalg.norm(tips[-1] - target)), work + spent
    return distance, work


@aw.evaluator("settling_time [s]", "final_distance [m]")
def settling(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Move the arm to its targets; return how long its tip swings at each, and its distance from them in the end."""
    simulation, duration, distance = Simulation(arm), 0.0, 0.0
    postures = aw.evaluate(arm, task).q[0, :, : simulation.model.nq]
    for target, posture in zip(task.target_positions, postures, strict=True):
        tips, _ = simulation.move(posture)
        moving = np.flatnonzero(np.linalg.norm(tips - tips[-1], axis=1) > SETTLED)
        duration += TIMESTEP * (int(moving[-1]) + 1 if len(moving) else 0)
        distance += float(np.linalg.norm(tips[-1] - target))
    return duration, distance


@aw.evaluator("first", "second")
def control(arm: aw.Arm, task: aw.Task) -> tuple[float, float]:
    """Return two random smooth functions of base, link lengths and joint axes, which physics does not predict."""
    axes = [[float(joint.axis == axis) for axis in AXES] for joint in arm.joints]
    lengths = [link.length / 0.3 for link in arm.links]
    x = np.concatenate([arm.base, lengths, np.ravel(axes)])
    frequencies, phases, amplitudes = _waves(len(x))
    first, second = 3.0 + amplitudes @ np.cos(frequencies @ x + phases)
    return float(np.exp(first)), float(np.exp(second))


@lru_cache
def _waves(n: int) -> tuple[Array, Array, Array]:
    """Return random Fourier features: a draw of two Gaussian processes with a length scale of 1.5."""
    rng = np.random.default_rng(n)
    frequencies = rng.normal(0.0, 1.0 / 1.5, (N_WAVES, n))
    return frequencies, rng.uniform(0.0, 2.0 * np.pi, N_WAVES), rng.normal(0.0, N_WAVES**-0.5, (2, N_WAVES))

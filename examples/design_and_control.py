"""An evaluator that needs the whole design: arm, gears and controller are simulated in MuJoCo on the task's cycle.

    pip install "armwright[studies]"
    armwright optimize examples/9-codesign-task.yaml --space examples/9-codesign-space.yaml \
        --evaluator examples/design_and_control.py:drive --out runs/codesign

The controller measures and commands 250 times a second, one period late: torque = weight of the arm
+ peak torque x (kp x error + kd x error of the speed). Drives deliver what their torque-speed lines allow.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import mujoco
import numpy as np

import armwright as aw

PERIOD = 0.004  # [s] of the controller
SUBSTEPS = 2
SETTLING = 0.2  # [s] after the last motion
NOTHING = 1e-9  # [kg], [kg m²] of a payload that is not carried
EFFICIENCY = 0.95  # of a belt


class Engine(Protocol):
    """A simulator of an arm. Arrays are (D,): one value for each joint."""

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return angles [rad], speeds [rad/s] and the torques that carry the arm [N m]."""
        ...

    def tip(self, q: np.ndarray) -> np.ndarray:
        """Return (3,) the position of the tip at these angles [m]."""
        ...

    def carry(self, mass: float) -> None:
        """Hold a payload [kg]."""
        ...

    def step(self, torque: np.ndarray) -> None:
        """Apply torques [N m] for a period of the controller."""
        ...


class MujocoEngine:
    """The model of an arm in MuJoCo, without contacts."""

    def __init__(self, mjcf: str, q: np.ndarray) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf)
        self.model.opt.timestep = PERIOD / SUBSTEPS
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.data, self.plan = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.site, self.payload = self.model.site("tip").id, self.model.body("payload").id
        self.full = float(self.model.body_mass[self.payload]), self.model.body_inertia[self.payload].copy()
        self.data.qpos[:] = q
        mujoco.mj_forward(self.model, self.data)

    def state(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.data.qpos.copy(), self.data.qvel.copy(), self.data.qfrc_bias.copy()

    def tip(self, q: np.ndarray) -> np.ndarray:
        self.plan.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.plan)
        return self.plan.site_xpos[self.site].copy()

    def carry(self, mass: float) -> None:
        full, inertia = self.full
        self.model.body_mass[self.payload] = mass or NOTHING
        self.model.body_inertia[self.payload] = inertia * (mass / full) if mass else NOTHING
        q, qd = self.data.qpos.copy(), self.data.qvel.copy()
        mujoco.mj_setConst(self.model, self.data)  # which resets the state
        self.data.qpos[:], self.data.qvel[:] = q, qd
        mujoco.mj_forward(self.model, self.data)

    def step(self, torque: np.ndarray) -> None:
        self.data.qfrc_applied[:] = torque
        mujoco.mj_step(self.model, self.data, SUBSTEPS)

    def check(self) -> None:
        """Raise ArithmeticError if the simulation became unstable."""
        if any(warning.number for warning in self.data.warning):
            raise ArithmeticError("the simulation became unstable; try softer gains")


@dataclass(frozen=True)
class Drives:
    """The drives of D joints behind their gears, (D,) each."""

    peak: np.ndarray  # [N m]
    corner: np.ndarray  # speed from which on the torque falls [rad/s]
    no_load: np.ndarray  # speed at which it is 0 [rad/s]
    power: np.ndarray  # heat at the peak torque [W]

    @classmethod
    def of(cls, arm: aw.Arm) -> "Drives":
        """Return the drives of an arm."""
        motors = [joint.actuator for joint in arm.joints if joint.actuator is not None]
        power = [(motor.voltage or 0.0) * (motor.current or 0.0) for motor in motors]
        peak, corner, no_load = zip(*((m.peak_torque, m.corner_speed, m.speed) for m in motors), strict=True)
        return cls(np.array(peak), np.array(corner), np.array(no_load), np.array(power))

    def limited(self, torque: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return the torques that they deliver at these speeds."""
        falling = np.clip((self.no_load - np.abs(speed)) / (self.no_load - self.corner), 0.0, 1.0)
        limit = self.peak * np.where(torque * speed > 0.0, falling, 1.0)
        return np.clip(torque, -limit, limit)


def geared(arm: aw.Arm, design: aw.Design) -> aw.Arm:
    """Return the arm with the gear of each joint between its drive and its link."""
    joints: list[aw.Joint] = []
    for number, joint in enumerate(arm.joints, start=1):
        gear, motor = float(design.params[f"gear_{number}"]), joint.actuator
        assert motor is not None
        behind = replace(
            motor,
            peak_torque=motor.peak_torque * gear * EFFICIENCY,
            speed=(motor.speed or 0.0) / gear,
            corner_speed=(motor.corner_speed or 0.0) / gear,
            rotor_inertia=(motor.rotor_inertia or 0.0) * gear**2,
            coulomb_friction=(motor.coulomb_friction or 0.0) * gear,
            viscous_friction=(motor.viscous_friction or 0.0) * gear**2,
        )
        joints.append(replace(joint, actuator=behind))
    return replace(arm, joints=tuple(joints))


@dataclass(frozen=True)
class Plan:
    """What the controller follows, every PERIOD: angles (R, D) [rad], speeds [rad/s] and payloads (R,) [kg]."""

    q: np.ndarray
    qd: np.ndarray
    payload: np.ndarray

    @property
    def duration(self) -> float:
        """The time of the cycle [s]."""
        return (len(self.q) - 1) * PERIOD


def paced(model: aw.CycleModel, design: aw.Design) -> Plan:
    """Return the cycle of an arm, each motion as much faster as its pace says; dwells, at rest, keep their time."""
    path = model.trajectory
    pace = np.where(path.payload > 0.0, float(design.params["pace_loaded"]), float(design.params["pace_empty"]))
    pace = np.where(np.abs(path.qd).max(axis=1) > 0.0, pace, 1.0)
    step = np.diff(path.time)
    time = np.concatenate([[0.0], np.cumsum(step / np.maximum(pace[:-1], pace[1:]))])
    at = np.arange(0.0, time[-1] + PERIOD, PERIOD)
    q, qd = (
        np.stack([np.interp(at, time, column) for column in values.T], axis=1)
        for values in (path.q, path.qd * pace[:, None])
    )
    return Plan(q, qd, path.payload[np.minimum(np.searchsorted(time, at + 1e-9, side="right") - 1, len(time) - 1)])


def follow(engine: Engine, plan: Plan, drives: Drives, kp: float, kd: float) -> tuple[float, float]:
    """Return the energy [J] and the tracking error [mm] of an arm on its cycle."""
    torque = np.zeros(len(drives.peak))
    energy, squares, carried = 0.0, 0.0, -1.0
    late = np.minimum(np.arange(len(plan.q) + round(SETTLING / PERIOD)), len(plan.q) - 1)
    for row in late:
        if plan.payload[row] != carried:
            carried = float(plan.payload[row])
            engine.carry(carried)
        q, qd, weight = engine.state()
        delivered = drives.limited(torque, qd)
        squares += float(np.sum((engine.tip(q) - engine.tip(plan.q[row])) ** 2))
        heat = drives.power * (delivered / drives.peak) ** 2
        energy += float(np.maximum(delivered * qd, 0.0).sum() + heat.sum()) * PERIOD
        torque = weight + drives.peak * (kp * (plan.q[row] - q) + kd * (plan.qd[row] - qd))
        engine.step(delivered)
    return energy, 1e3 * float(np.sqrt(squares / len(late)))


@aw.evaluator("duration [s]", "energy [J]", "tracking_error [mm]")
def drive(arm: aw.Arm, task: aw.Task, design: aw.Design) -> tuple[float, float, float]:
    """Cycle time, electrical energy of a cycle, and root mean square distance of the tip from its plan."""
    arm = geared(arm, design)
    model = aw.cycle_model(arm, task)
    plan = paced(model, design)
    engine = MujocoEngine(model.mjcf, plan.q[0])
    kp, kd = float(design.params["kp"]), float(design.params["kd"])
    energy, error = follow(engine, plan, Drives.of(arm), kp, kd)
    engine.check()
    return plan.duration, energy, error

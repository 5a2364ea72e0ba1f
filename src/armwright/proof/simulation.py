"""The exported model of a design, driven through its trajectory in MuJoCo.

Each joint is driven by the torque of the trajectory as feed-forward and by its servo, kp (q* - q), with q* from the
trajectory, interpolated between its rows. What damps is the friction of the joints. That of a gear is a share of the
torque that it passes on, or in braking of the torque before it, by the step before.
"""

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.cycle.trajectory import PERIOD, Trajectory
from armwright.proof.simulation_model import NOTHING, TIMESTEP

MAX_SATURATED = 0.02  # share of the cycle in which a joint may be at its torque limit
AT_LIMIT = 1.0 - 1e-6  # share of the limit
SUBSTEPS = round(PERIOD / TIMESTEP)
ORIENTATION = 3  # number of angles of a target that states all axes
MAX_CONTACTS = 20  # in a record
PASS, FAIL = "pass", "fail"


@dataclass(frozen=True)
class Arrival:
    """The tip at the end of a dwell."""

    step: int  # number of the step, counted from 1
    target: str  # name of the target
    tip_error: float  # distance from the target [m]
    angle_error: float  # angle of the tool from the target's axis or orientation [rad]; 0 without either
    droop: float = float("nan")  # distance from the target without feed-forward [m]


@dataclass(frozen=True)
class JointLoad:
    """Loads of a joint over the cycle, simulated and as in the trajectory.

    Torques are of the drive [N m], or forces [N]; speeds [rad/s] or [m/s].
    """

    joint: str
    peak_torque: float
    rms_torque: float
    claimed_peak_torque: float
    claimed_rms_torque: float
    peak_speed: float
    saturated_fraction: float


@dataclass(frozen=True)
class Contact:
    """Two geoms that touched first at a time [s]; depth: at most [m]."""

    geoms: tuple[str, str]
    time: float
    depth: float


@dataclass(frozen=True)
class Drive:
    """A simulated cycle; S substeps of D joints."""

    tau: Array  # (S, D) torques of the drives [N m], or forces [N]
    speed: Array  # (S, D) speeds at the substeps
    arrivals: tuple[Arrival, ...]  # at the end of each dwell
    contacts: tuple[Contact, ...]  # what touched, by the first time
    stable: bool  # false if MuJoCo reported values that are not finite


@dataclass(frozen=True)
class SimulatedDesign:
    """The verdict on a design: passed without reasons, and what was measured."""

    design: int
    verdict: str  # pass or fail
    reasons: tuple[str, ...]  # why it failed
    cycle_time: float  # duration of the trajectory [s]
    energy: float  # mechanical work of the drives, without what they brake [J]
    targets: tuple[Arrival, ...]  # at the end of each dwell
    joints: tuple[JointLoad, ...]  # loads of each moving joint
    contacts: tuple[Contact, ...]  # what touched


def mujoco_version() -> str:
    """Return the version of MuJoCo."""
    return str(import_module("mujoco").__version__)


class _Driver:
    """A model of `to_simulation_mjcf`, its state and what is recorded."""

    def __init__(self, model_xml: str, trajectory: Trajectory, names: tuple[str, ...]) -> None:
        self._mujoco: Any = import_module("mujoco")
        self._model = self._mujoco.MjModel.from_xml_string(model_xml)
        self._data = self._mujoco.MjData(self._model)
        self._trajectory, self._names = trajectory, names
        self._n = trajectory.q.shape[1]
        self._payload = self._model.body("payload").id
        self._full = float(self._model.body_mass[self._payload]), self._model.body_inertia[self._payload].copy()
        self._tip = self._model.site("tip").id
        self._contacts: dict[tuple[str, str], Contact] = {}
        self.joints = [str(self._model.joint(i).name) for i in range(self._model.njnt)]
        is_limited = self._model.jnt_actfrclimited.astype(bool)
        self.torque_limits = np.where(is_limited, self._model.jnt_actfrcrange[:, 1], np.inf)  # (D,) [N m] or [N]
        self._coulomb, user = self._model.dof_frictionloss.copy(), self._model.jnt_user
        self._gear = user[:, 0] if user.shape[1] else np.zeros(self._n)  # share of friction
        geoms = (str(self._model.geom(i).name) for i in range(self._model.ngeom))
        self._obstacles = {name: o for o, name in enumerate(filter(lambda name: name.startswith("obstacle_"), geoms))}

    def tolerance(self, target: str) -> tuple[float, float]:
        """Return the tolerance of a target's position [m] and angle [rad]."""
        user = self._model.site(f"target_{target}").user
        return float(user[0]), float(user[1])

    def run(self, feed_forward: bool = True) -> Drive:
        """Drive the whole cycle from its start; without feed-forward, by the servos alone."""
        self._mujoco.mj_resetData(self._model, self._data)
        self._contacts.clear()
        trajectory, data, model, n = self._trajectory, self._data, self._model, self._n
        rows = len(trajectory.time)
        tau, speed = np.empty((2, (rows - 1) * SUBSTEPS, n))
        arrivals: list[Arrival] = []
        data.qpos[:] = trajectory.q[0]
        servo, forward = self._commands()
        forward *= feed_forward
        carried = np.nan
        at = 0
        for row in range(rows):
            self._mujoco.mj_kinematics(model, data)
            if trajectory.target[row] >= 0:
                arrivals.append(self._arrival(row))
            if row == rows - 1:
                break
            if trajectory.payload[row] != carried:
                carried = trajectory.payload[row]
                self._carry(carried)
            for _ in range(SUBSTEPS):
                data.ctrl[:n], data.ctrl[n:] = servo[at], forward[at]
                speed[at] = data.qvel
                self._rub()
                self._mujoco.mj_step(model, data)
                tau[at] = data.qfrc_actuator
                at += 1
                if data.ncon:
                    self._note_contacts(row)
        stable = not any(warning.number for warning in data.warning) and bool(np.isfinite(data.qpos).all())
        return Drive(tau, speed, tuple(arrivals), tuple(self._contacts.values()), stable)

    def _rub(self) -> None:
        """Set the friction of the joints by the torques that their gears pass on."""
        data, model = self._data, self._model
        passed = data.qfrc_actuator + data.qfrc_passive + data.qfrc_constraint - model.dof_armature * data.qacc
        loads = np.abs(passed) / np.where(passed * data.qvel > 0.0, 1.0, 1.0 + self._gear)
        model.dof_frictionloss[:] = self._coulomb + self._gear * loads

    def _commands(self) -> tuple[Array, Array]:
        """Return the (S, D) positions for the servos and torques for the feed-forward, at the middle of substeps.

        They are interpolated between rows, but not towards a row from which on the arm carries something else.
        """
        trajectory = self._trajectory
        same = np.diff(trajectory.payload) == 0.0
        share = np.where(same[:, None], (np.arange(SUBSTEPS) + 0.5) / SUBSTEPS, 0.0)[:, :, None]

        def between(values: Array) -> Array:
            return (values[:-1, None] + share * (values[1:] - values[:-1])[:, None]).reshape(-1, self._n)

        return between(trajectory.q), between(trajectory.tau)

    def _carry(self, mass: float) -> None:
        """Give the payload this mass, and in proportion its inertia; NOTHING for 0."""
        full, inertia = self._full
        self._model.body_mass[self._payload] = mass if mass > 0.0 else NOTHING
        self._model.body_inertia[self._payload] = inertia * (mass / full) if mass > 0.0 else NOTHING
        # mj_setConst computes in the reference posture, and leaves the state there
        state = self._data.qpos.copy(), self._data.qvel.copy(), self._data.time
        self._mujoco.mj_setConst(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:], self._data.time = state

    def _arrival(self, row: int) -> Arrival:
        data, model = self._data, self._model
        name = self._names[int(self._trajectory.target[row])]
        site = model.site(f"target_{name}")
        tip, goal = (data.site_xmat[i].reshape(3, 3) for i in (self._tip, site.id))
        distance = float(np.linalg.norm(data.site_xpos[self._tip] - data.site_xpos[site.id]))
        return Arrival(int(self._trajectory.step[row]), name, distance, angle_between(tip, goal, int(site.user[2])))

    def _note_contacts(self, row: int) -> None:
        """Note what touches, except for what tool and payload may touch at a row of the trajectory."""
        carried, allowed = self._trajectory.payload[row] > 0.0, self._trajectory.allowed[row]
        for contact in self._data.contact:
            first, second = sorted(self._model.geom(int(geom)).name for geom in contact.geom)
            depth = (
                allowed[self._obstacles[first]] if first in self._obstacles and second in ("payload", "tool") else -1.0
            )
            if -contact.dist <= depth or (second == "payload" and not carried):
                continue
            known = self._contacts.get((first, second))
            time = float(self._data.time) if known is None else known.time
            depth = max(-float(contact.dist), 0.0 if known is None else known.depth)
            self._contacts[first, second] = Contact((first, second), time, depth)


def angle_between(first: Array, second: Array, n_angular: int) -> float:
    """Return the angle between two orientations (3, 3), of which no axis, the z axis or all count [rad]."""
    if n_angular == 0:
        return 0.0
    if n_angular < ORIENTATION:
        a, b = first[:, 2], second[:, 2]
        return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    change = second.T @ first
    vector = 0.5 * np.array([change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1]])
    return float(np.arctan2(np.linalg.norm(vector), 0.5 * (np.trace(change) - 1.0)))


def simulate_design(number: int, model_xml: str, trajectory: Trajectory, names: tuple[str, ...]) -> SimulatedDesign:
    """Drive a design with and without feed-forward, and return the verdict."""
    driver = _Driver(model_xml, trajectory, names)
    found, alone = driver.run(), driver.run(feed_forward=False)
    targets = tuple(
        replace(one, droop=other.tip_error) for one, other in zip(found.arrivals, alone.arrivals, strict=True)
    )
    saturated = (np.abs(found.tau) >= AT_LIMIT * driver.torque_limits).mean(axis=0)
    joints = tuple(
        JointLoad(
            joint=name,
            peak_torque=float(np.abs(found.tau[:, i]).max()),
            rms_torque=float(np.sqrt((found.tau[:, i] ** 2).mean())),
            claimed_peak_torque=float(np.abs(trajectory.tau[:, i]).max()),
            claimed_rms_torque=float(np.sqrt((trajectory.tau[:, i] ** 2).mean())),
            peak_speed=float(np.abs(found.speed[:, i]).max()),
            saturated_fraction=float(saturated[i]),
        )
        for i, name in enumerate(driver.joints)
    )
    reasons = _reasons(found, targets, joints, driver)
    energy = float(np.maximum(found.tau * found.speed, 0.0).sum() * TIMESTEP)
    verdict = FAIL if reasons else PASS
    time = float(trajectory.time[-1])
    return SimulatedDesign(number, verdict, reasons, time, energy, targets, joints, found.contacts)


def _reasons(
    found: Drive, targets: tuple[Arrival, ...], joints: tuple[JointLoad, ...], driver: _Driver
) -> tuple[str, ...]:
    """Return why a design fails, the same rule as `benchmarks/check_simulation.py` applies."""
    reasons = [] if found.stable else ["the simulation became unstable"]
    for one in targets:
        distance, angle = driver.tolerance(one.target)
        if not one.tip_error < distance:
            reasons.append(
                f"step {one.step}: the tip is {1e3 * one.tip_error:.3g} mm off target {one.target} "
                f"(tolerance {1e3 * distance:g} mm)"
            )
        if not one.angle_error < angle:
            reasons.append(
                f"step {one.step}: the tool is {np.degrees(one.angle_error):.3g}° off target {one.target} "
                f"(tolerance {np.degrees(angle):.3g}°)"
            )
    for contact in found.contacts[:MAX_CONTACTS]:
        first, second = contact.geoms
        reasons.append(f"{first} touches {second} at {contact.time:.3f} s, {1e3 * contact.depth:.2g} mm deep at most")
    for joint in joints:
        if joint.saturated_fraction > MAX_SATURATED:
            reasons.append(f"{joint.joint} is at its torque limit for {joint.saturated_fraction:.1%} of the cycle")
    return tuple(reasons)

"""Per-target kinematics and statics of arms, not aggregated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError, TaskError
from armwright.kinematics.arms.actuation import Actuation
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays, carrying, stack_arms
from armwright.kinematics.arms.bearings import across_axis, bearing_limits, bearing_loads
from armwright.kinematics.arms.forward import Frames, forward_kinematics, jacobian_of
from armwright.kinematics.contact.clearance import clearances, straight_motor_clearance
from armwright.kinematics.cycle.cycle_loads import CycleLoads, cycle_bearing_loads, cycle_loads, holding_torques
from armwright.kinematics.cycle.cycle_path import CyclePaths, find_paths, rough_paths
from armwright.kinematics.cycle.reserves import Reserves, bearing_reserves, holding_reserves, reserves_of
from armwright.kinematics.cycle.supply_currents import SupplyCurrents, supply_currents
from armwright.kinematics.cycle.torque_terms import TorqueTerms, inertia_matrices, torque_terms
from armwright.kinematics.devices import Device
from armwright.kinematics.ik.ik import UPDATES, Postures, solve_postures
from armwright.kinematics.reach.compliance import joint_loads, own_loads, unit_payload
from armwright.problem.dexterous_volume import dexterous_volumes
from armwright.problem.scene import Scene, task_scene
from armwright.robot.arm import Arm
from armwright.spaces.tool_mount import carrying_tool
from armwright.tasks.targets import position_targets
from armwright.tasks.task import Task
from armwright.tasks.workspace import sample_regions

NO_CYCLE = "paths of cycles do not support such arms yet; try a task without a cycle"
CYCLE_GAP = 1e-4  # [m] that bodies keep along a cycle, because drives and samples are a little off its path


@dataclass(frozen=True, kw_only=True)
class Evaluation(Scene):
    """A scene in which N arms of up to J joints were evaluated; 0 for joints that an arm does not have.

    Where the cycle stops at a target, the posture is the cycle's. Clearances, loads, the workspace and Jacobians are
    computed on first use.
    """

    arms: ArmArrays
    q: Array  # (N, T, J) kept joint angles [rad] or displacements [m]; 0 for a fixed joint
    reached: Array  # (N, T, 3) position of the tip [m]
    position_error: Array  # (N, T) distance from the target [m]
    angle_error: Array  # (N, T) of the tool from the target's axis or orientation [rad]; 0 where it has none
    joint_torques: Array  # (N, T, J) that hold the posture against gravity [N m], or forces [N]; 0 for a fixed joint
    cycle_paths: CyclePaths | None = None
    durations: Array | None = None  # (N, M) that the motions keep [s]; None for those of the task and the drives
    device: Device = "cpu"

    def __len__(self) -> int:
        return len(self.q)

    @property
    def motor_torques(self) -> Array:
        """(N, T, J) at the actuators: of a sliding joint its force times its travel [N m]."""
        return self.joint_torques * self.arms.travel[:, None]

    @property
    def paths(self) -> CyclePaths:
        """The arms along the motions of the cycle; SettingsError if the task has none."""
        self.require("cycle")
        return cast("CyclePaths", self.cycle_paths)

    @property
    def drives(self) -> Actuation:
        """The actuation of arms that have actuators."""
        return cast("Actuation", self.arms.actuation)

    @cached_property
    def entry(self) -> Array | None:
        """(N, 1, B, D) posture at the first pose of each block of the cycle [rad] or [m]; None without a cycle."""
        return None if self.cycle_paths is None else self.cycle_paths.entry[:, None]

    @property
    def is_stopped(self) -> NDArray[np.bool_]:
        """(N,) True for arms whose evaluation ended before all was known, of which that is NaN (`CyclePaths`)."""
        return np.zeros(len(self), dtype=bool) if self.cycle_paths is None else self.cycle_paths.is_stopped

    @cached_property
    def torque_terms(self) -> list[TorqueTerms]:
        """Terms of the torques along the cycle, for each group of arms with loads."""
        return torque_terms(self.paths, float(self.payload.max()), self.device, wrenches=self.has_bearing_limits)

    @property
    def has_bearing_limits(self) -> bool:
        """Whether the maker of an actuator states what it allows across its shaft."""
        drives = self.arms.actuation
        return drives is not None and bool(np.isfinite(bearing_limits(drives)[self.arms.motion < FIXED]).any())

    @cached_property
    def loads(self) -> CycleLoads:
        """Durations, torques and speeds along the cycle; SettingsError if a duration is not known."""
        return cycle_loads(self.paths, self.torque_terms, self.durations, self.device)

    @cached_property
    def reserves(self) -> Reserves:
        """Reserves of the actuators along the cycle, else at the targets; SettingsError if a duration is not known."""
        along = self.cycle_paths is not None
        found = reserves_of(self.loads, self.drives) if along else holding_reserves(self.joint_torques, self.drives)
        if self.has_bearing_limits:
            across = self.motion_bearing_loads if along else self.bearing_loads
            found |= bearing_reserves(across, bearing_limits(self.drives))
        return found

    def keeping(self, durations: Array | None) -> Self:
        """Return the evaluation with these durations of the motions (N, M) [s]; itself without any."""
        if durations is None:
            return self
        kept = replace(self, durations=durations)
        vars(kept).update(torque_terms=self.torque_terms, _clearances=self._clearances)
        return kept

    def reloaded(self, scene: Scene, drives: Actuation | None = None) -> "Evaluation":
        """Return the arms on the same paths in the same time, with other payloads and drives, None for their own.

        Without a cycle, the arms take their postures anew.
        """
        arms = replace(carrying(self.arms, scene.load_shape), actuation=drives or self.arms.actuation)
        if self.cycle_paths is None:
            return evaluate_arrays(arms, scene, self.device, self.q)
        paths = replace(self.cycle_paths, groups=tuple(replace(g, arms=arms[g.index]) for g in self.cycle_paths.groups))
        changed = replace(self, payload=scene.payload, load_shape=scene.load_shape, arms=arms, cycle_paths=paths)
        vars(changed).update(_clearances=self._clearances)
        return changed

    @cached_property
    def supply(self) -> SupplyCurrents:
        """Currents of the actuators along the cycle; SettingsError if a duration is not known."""
        return supply_currents(self.loads, self.drives)

    def worst_torques(self, measure: Callable[[Array], Array]) -> Array:
        """Return (N, T) a measure of holding torques, the largest of a target's posture and of the motions to it.

        measure: from torques of motors (N, K, J) [N m] to (N, K), of K postures.
        """
        at_targets = measure(self.motor_torques)
        if self.cycle_paths is None:
            return at_targets
        torques = holding_torques(self.cycle_paths, self.torque_terms)
        n, m, f, dof = torques.shape
        along = measure(torques.reshape(n, m * f, dof) * self.arms.travel[:, None])
        return self.largest_on_motions(along.reshape(n, m, f).max(axis=2), at_targets)

    def worst_loads(self, measure: Callable[[Array, Array], Array]) -> Array:
        """Return (N, T) a measure of torques and speeds, the largest along the motions of steps to a target, else 0.

        measure: from torques [N m] and speeds [rad/s] of joints, each (N, K, J), to (N, K), of K instants.
        """
        n, m, f, dof = self.loads.torques.shape
        torques, speeds = (values.reshape(n, m * f, dof) for values in (self.loads.torques, self.loads.speeds))
        return self.largest_on_motions(measure(torques, speeds).reshape(n, m, f).max(axis=2))

    @cached_property
    def bearing_loads(self) -> Array:
        """(N, T, J, 3) largest tilting moment [N m], axial and radial force [N] of each joint; 0 if it does not turn.

        They are of a target's posture and of the motions of steps to it; SettingsError if a duration is not known.
        """
        own, unit = (
            across_axis(self.arms, self.frames.axis, *joint_loads(self.frames, loads))
            for loads in (own_loads(self.arms, self.frames), unit_payload(self.arms, self.frames))
        )
        at_targets = bearing_loads(own + self.payload[:, None, None, None] * unit)
        if self.cycle_paths is None:
            return at_targets
        return self.largest_on_motions(self.motion_bearing_loads, at_targets)

    @cached_property
    def motion_bearing_loads(self) -> Array:
        """(N, M, J, 3) the same in each motion of the cycle; SettingsError if a duration is not known."""
        terms = self.torque_terms
        if not all(own.wrenches.size for own in terms):
            terms = torque_terms(self.paths, float(self.payload.max()), self.device, wrenches=True)
        return cycle_bearing_loads(self.paths, terms, self.loads.durations, self.device)

    def largest_on_motions(self, along: Array, at_targets: Array | float = 0.0) -> Array:
        """Return (N, T, ...) the larger of a target's value and those of the motions (N, M, ...) of steps to it."""
        worst = np.array(np.broadcast_to(at_targets, (*self.position_error.shape, *along.shape[2:])))
        visited, motions, first = self.paths.plan.visits
        worst[:, visited] = np.maximum(worst[:, visited], np.maximum.reduceat(along[:, motions], first, axis=1))
        return worst

    @cached_property
    def frames(self) -> Frames:
        """Joint frames in the kept postures, in float64."""
        return forward_kinematics(self.arms, self.q)

    @cached_property
    def jacobian(self) -> Array:
        """(N, T, 3, J) derivative of the tip position by the joints in the kept posture [m/rad] or [m/m]."""
        return jacobian_of(self.arms, self.frames)

    @property
    def motor_jacobian(self) -> Array:
        """(N, T, 3, J) the same by the motion of the actuators [m/rad]."""
        return self.jacobian * self.arms.travel[:, None, None]

    @cached_property
    def motor_inertia(self) -> Array:
        """(N, T, J, J) inertia matrix of the kept posture at the actuators, known rotors included [kg m²]."""
        heaviest = float(self.payload.max())
        carried = self.payload / heaviest if heaviest > 0.0 else self.payload
        inertia = inertia_matrices(self.arms, self.q, carried, heaviest, self.device)
        if self.arms.actuation is not None:
            rotors = np.nan_to_num(self.arms.actuation.rotor_inertia)
            inertia = inertia + (rotors[:, :, None] * np.eye(self.arms.dof))[:, None]
        travel = self.arms.travel[:, None]
        inertia = self.arms.by_independent(self.arms.by_independent(inertia).swapaxes(-1, -2))
        return inertia * travel[..., None] * travel[..., None, :]

    @property
    def manipulability(self) -> Array:
        """(N, T) sqrt(det J Jᵀ) of the position Jacobian J in the kept posture (Yoshikawa 1985) [m³]."""
        return self._singular_values.prod(axis=-1)

    @property
    def dexterity(self) -> Array:
        """(N, T) the smallest singular value of J over the largest; 0 where the tip cannot move in some direction."""
        largest = self._singular_values[..., 0]
        return self._singular_values[..., -1] / np.where(largest > 0.0, largest, 1.0)

    @cached_property
    def _singular_values(self) -> Array:
        """(N, T, 3) of J, from the largest on."""
        jacobian = self.jacobian
        return np.sqrt(np.maximum(np.linalg.eigvalsh(jacobian @ jacobian.swapaxes(-1, -2))[..., ::-1], 0.0))

    @cached_property
    def workspace_error(self) -> Array:
        """(N, W) distance of the tip from each point of the workspace [m]; SettingsError where there is none."""
        self.require("workspace")
        points = sample_regions(self.workspace)
        reached = solve_postures(self.arms, points, precision=self.arms.precision, device=self.device).reached
        return np.linalg.norm(reached.astype(np.float64) - points, axis=-1)

    @cached_property
    def dexterous_volume(self) -> Array:
        """(N,) share of the workspace with enough directions; SettingsError if no region has directions."""
        self.require("directions")
        return dexterous_volumes(self.arms, self.workspace, self.obstacles)

    @property
    def excess_error(self) -> Array:
        """(N, T) position error beyond the stated tolerance [m]; the error itself where none is stated."""
        return np.maximum(self.position_error - self.target_arrays.stated_tolerance, 0.0)

    @property
    def excess_angle(self) -> Array:
        """(N, T) angle error likewise [rad]."""
        return np.maximum(self.angle_error - self.target_arrays.stated_angle_tolerance, 0.0)

    @property
    def unreached(self) -> NDArray[np.bool_]:
        """(N, T) whether the tip or the tool's direction is off by a target's tolerance or more."""
        target_arrays = self.target_arrays
        return (self.position_error >= target_arrays.tolerance) | (self.angle_error >= target_arrays.angle_tolerance)

    @property
    def self_clearance(self) -> Array:
        """(N, T) smallest distance of two links, motor bodies or the column, no neighbours [m]; infinite without any.

        It and the other clearances are of a target's posture and of the motions of steps to it. Motor bodies may not
        overlap in the straight posture either.
        """
        return self._clearances[0]

    @property
    def obstacle_clearance(self) -> Array:
        """(N, T) smallest distance of a link or motor body from an obstacle [m]; infinite where there is none."""
        return self._clearances[1]

    @property
    def clearance(self) -> Array:
        """(N, T) the smaller of both [m]; below 0 where the arm is in an obstacle or in itself."""
        return np.minimum(*self._clearances)

    @property
    def penetration(self) -> Array:
        """(N, T) how deep the arm is in an obstacle or in itself [m]; in a cycle from CYCLE_GAP apart."""
        return np.maximum(0.0, (0.0 if self.plan is None else CYCLE_GAP) - self.clearance)

    @cached_property
    def _clearances(self) -> tuple[Array, Array]:
        visited = () if self.plan is None else self.plan.targets  # whose clearances the motions tell
        elsewhere = np.array([t for t in range(self.q.shape[1]) if t not in visited], dtype=np.intp)
        rules = None if self.tip_rules is None else self.tip_rules[elsewhere]
        own, clear = np.full((2, *self.q.shape[:2]), np.inf)
        if len(elsewhere):
            at_targets = clearances(self.arms, self.q[:, elsewhere], self.obstacles, self.device, rules)
            own[:, elsewhere], clear[:, elsewhere] = at_targets
        if self.cycle_paths is not None:
            own = -self.largest_on_motions(-self.cycle_paths.self_clearance, -own)
            clear = -self.largest_on_motions(-self.cycle_paths.obstacle_clearance, -clear)
        if self.arms.motor_bodies is not None:
            own = np.minimum(own, straight_motor_clearance(self.arms, self.device)[:, None])
        return own, clear


def evaluate(
    arms: Arm | Sequence[Arm],
    targets: ArrayLike | Task,
    device: Device = "cpu",
    payload: ArrayLike | None = None,
) -> Evaluation:
    """Evaluate every arm at every target. An unreached target is a result, never an exception.

    Args:
        arms: One arm, or N arms.
        targets: (T, 3) positions [m], or a task, which brings directions, payloads, obstacles, cycle and workspace,
            and a tool, which is mounted on arms that carry none.
        device: Where the arms are evaluated.
        payload: (T,) mass carried by the tip at each position, or one for all [kg]; 0 by default.

    Examples:
        >>> import armwright as aw
        >>> space = aw.paper_space()
        >>> arms = [space.arm(design) for design in space.sample(3, seed=0)]
        >>> aw.evaluate(arms, [[0.3, 0.0, 0.2], [0.0, 0.3, 0.2]]).position_error.shape
        (3, 2)
        >>> aw.evaluate(arms[0], aw.load_task("machine-tending")).position_error.shape
        (1, 8)
    """
    arms = [arms] if isinstance(arms, Arm) else arms
    if isinstance(targets, Task):
        if payload is not None:
            raise SettingsError("expected a task alone, got a payload beside it; change the task, or give positions")
        scene = task_scene(targets, *targets.cases[0])
        return evaluate_arrays(stack_arms([carrying_tool(arm, targets.tool) for arm in arms]), scene, device)
    positions = np.asarray(targets, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not len(positions) or not np.all(np.isfinite(positions)):
        raise TaskError(f"targets: expected finite numbers of shape (T, 3), T >= 1, got shape {positions.shape}")
    t = len(positions)
    loads = np.asarray(0.0 if payload is None else payload, dtype=np.float64)
    if loads.shape not in ((), (t,)) or not np.all((loads >= 0.0) & np.isfinite(loads)):
        raise TaskError(f"payload: expected 1 or {t} values >= 0 kg, got {payload}")
    scene = Scene(positions, np.broadcast_to(loads, (t,)).copy(), position_targets(t))
    return evaluate_arrays(stack_arms(arms), scene, device)


def evaluate_arrays(
    arrays: ArmArrays, scene: Scene, device: Device = "cpu", initial_q: ArrayLike | None = None,
    candidates: Array | None = None, roughly_near: Array | None = None,
) -> Evaluation:  # fmt: skip
    """Evaluate stacked arms at every target of a scene, in their precision.

    Args:
        arrays: N arms.
        scene: T targets.
        device: where the arms are evaluated.
        initial_q: initial joint values [rad] or [m] that broadcast to (N, T, D); None for the straight posture. The
            restarts of the targets begin elsewhere. Where the cycle stops, its postures count instead.
        candidates: (N, B, K, D) postures at the first pose of each block of the cycle to choose from; None for those
            that the inverse kinematics finds.
        roughly_near: (N, B, D) postures near those at the first pose of each block of the cycle, from which the paths
            are estimated (`rough_paths`); None for the paths themselves.
    """
    targets, arrays = scene.targets, carrying(arrays, scene.load_shape)

    def solve(initial: ArrayLike | None, updates: int = UPDATES, restarts: int = 0) -> Postures:
        return solve_postures(
            arrays, targets, updates, initial_q=initial, payload=scene.payload, target_arrays=scene.target_arrays,
            restarts=restarts, precision=arrays.precision, device=device,
            motions=None if scene.plan is None else arrays.general_motions,
        )  # fmt: skip

    restarts = scene.target_arrays.restarts
    if scene.plan is not None and arrays.couplings is not None:
        raise ArmError(f"an arm has joints that follow others; {NO_CYCLE}")
    if scene.plan is None:
        paths, postures = None, solve(initial_q, restarts=restarts)
    else:
        if roughly_near is None:
            heaviest = float(scene.payload.max())
            paths = find_paths(arrays, scene.plan, scene.obstacles, None, device, candidates, heaviest)
        else:
            paths = rough_paths(arrays, scene.plan, roughly_near, scene.obstacles, device)
        q = paths.postures(len(targets))
        if np.isnan(q).any():
            q = np.where(np.isnan(q), solve(initial_q, restarts=restarts).q, q)
        postures = solve(q, updates=0)
    reached = postures.reached.astype(np.float64)
    return Evaluation(
        **vars(scene),
        arms=arrays,
        q=postures.q.astype(np.float64),
        reached=reached,
        position_error=np.linalg.norm(reached - targets, axis=-1),
        angle_error=postures.angle.astype(np.float64),
        joint_torques=postures.torque.astype(np.float64),
        cycle_paths=paths,
        device=device,
    )

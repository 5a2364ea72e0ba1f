"""Drive exported designs in MuJoCo, and measure them in Coal: `check_simulation.py RUN/designs/NNNN ...`.

Reads arm.xml and trajectory.csv of each folder, and prints its verdict by the rules of docs/method.md: every dwell ends
within the target's tolerance, nothing touches, and no joint is at its torque limit for more than 2 % of the cycle. Tool
and payload are bodies, which may be as deep in obstacles as the trajectory allows. Coal measures how far they keep from
all obstacles along the trajectory, beyond these depths. Nothing here is from armwright.
"""

import csv
import sys
from pathlib import Path
from typing import Any

import coal
import mujoco
import numpy as np

SHARE, NOTHING = 0.02, 1e-9


def read_rows(folder: Path) -> list[dict[str, str]]:
    """Return the rows of trajectory.csv."""
    with (folder / "trajectory.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def check(folder: Path) -> list[str]:
    """Return why a design fails; nothing if it passes."""
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    data = mujoco.MjData(model)
    rows, n = read_rows(folder), model.nu // 2
    q, tau = (np.array([[float(r[f"{x}_{k + 1}"]) for k in range(n)] for r in rows]) for x in ("q", "tau"))
    servo = np.array([model.actuator(f"servo_{k + 1}").id for k in range(n)])
    forward = np.array([model.actuator(f"ff_{k + 1}").id for k in range(n)])
    payload, tip = model.body("payload").id, model.site("tip").id
    mass, inertia = model.body_mass[payload], model.body_inertia[payload].copy()
    substeps = round((float(rows[1]["time"]) - float(rows[0]["time"])) / model.opt.timestep)
    names = [model.geom(g).name for g in range(model.ngeom)]
    obstacles = [name for name in names if name.startswith("obstacle_")]
    limit = np.where(model.jnt_actfrclimited, model.jnt_actfrcrange[:, 1], np.inf)
    coulomb, gear = model.dof_frictionloss.copy(), model.jnt_user[:, 0] if model.nuser_jnt else 0.0
    faults, saturated, steps = [], np.zeros(n), 0
    data.qpos[:] = q[0]
    for i, row in enumerate(rows):
        mujoco.mj_kinematics(model, data)
        if row["target"]:
            goal = model.site(f"target_{row['target']}").id
            far, turned, kind = model.site_user[goal][:3]
            if np.linalg.norm(data.site_xpos[tip] - data.site_xpos[goal]) >= far:
                faults.append(f"step {row['step']}: the tip misses {row['target']}")
            change = data.site_xmat[goal].reshape(3, 3).T @ data.site_xmat[tip].reshape(3, 3)
            cosine = {0: 1.0, 2: change[2, 2], 3: (np.trace(change) - 1.0) / 2.0}[int(kind)]
            if np.arccos(np.clip(cosine, -1.0, 1.0)) >= turned:
                faults.append(f"step {row['step']}: the tool is tilted at {row['target']}")
        if i == len(rows) - 1:
            break
        if i == 0 or row["payload"] != rows[i - 1]["payload"]:
            carried = float(row["payload"])
            model.body_mass[payload] = carried or NOTHING
            model.body_inertia[payload] = inertia * carried / mass if carried else NOTHING
            state = data.qpos.copy(), data.qvel.copy()
            mujoco.mj_setConst(model, data)
            data.qpos[:], data.qvel[:] = state
        for s in range(substeps):
            now = (s + 0.5) / substeps if rows[i + 1]["payload"] == row["payload"] else 0.0
            data.ctrl[servo], data.ctrl[forward] = ((1.0 - now) * x[i] + now * x[i + 1] for x in (q, tau))
            after = data.qfrc_actuator + data.qfrc_passive + data.qfrc_constraint - model.dof_armature * data.qacc
            share = np.where(after * data.qvel > 0.0, gear, gear / (1.0 + gear))
            model.dof_frictionloss[:] = coulomb + share * np.abs(after)
            mujoco.mj_step(model, data)
            saturated += np.abs(data.qfrc_actuator) >= (1.0 - 1e-6) * limit
            steps += 1
            for contact in data.contact:
                first, second = sorted(names[g] for g in contact.geom)
                if "payload" in (first, second) and float(row["payload"]) == 0.0:
                    continue
                may_touch = first in obstacles and second in ("tool", "payload")
                if may_touch and -contact.dist <= float(row[f"allowed_{obstacles.index(first) + 1}"]):
                    continue
                touching = f"{first} touches {second}"
                faults += [touching] if touching not in faults else []
    return faults + [f"joint {k + 1} is at its limit" for k in np.flatnonzero(saturated > SHARE * steps)]


def solid(model: Any, data: Any, g: int) -> tuple[Any, coal.Transform3s]:
    """Return a geom in Coal, with its pose."""
    size, at = model.geom_size[g], coal.Transform3s(data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g])
    match mujoco.mjtGeom(int(model.geom_type[g])):
        case mujoco.mjtGeom.mjGEOM_PLANE:
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), at
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return coal.Sphere(size[0]), at
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return coal.Cylinder(size[0], 2.0 * size[1]), at
        case mujoco.mjtGeom.mjGEOM_BOX:
            return coal.Box(*(2.0 * size)), at
        case _:  # a mesh
            mesh, corners = model.mesh(model.geom_dataid[g]), coal.StdVec_Vec3s()
            corners.extend(model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]].astype(np.float64))
            return coal.Convex.convexHull(corners, False, "Qt"), at


def distance_by_coal(folder: Path) -> float:
    """Return the least distance of tool and payload from obstacles along the trajectory, and beyond its depths [m]."""
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    data, least = mujoco.MjData(model), np.inf
    tips = [g for g in range(model.ngeom) if model.geom(g).name in ("tool", "payload")]
    obstacles = [g for g in range(model.ngeom) if model.geom(g).name.startswith("obstacle_")]
    for row in read_rows(folder):
        data.qpos[:] = [float(row[f"q_{k + 1}"]) for k in range(model.nq)]
        mujoco.mj_kinematics(model, data)
        for tip in tips:
            if model.geom(tip).name == "payload" and float(row["payload"]) == 0.0:
                continue
            for k, obstacle in enumerate(obstacles):
                allowed = float(row[f"allowed_{k + 1}"])
                pair = (*solid(model, data, tip), *solid(model, data, obstacle))
                found = coal.distance(*pair, coal.DistanceRequest(), coal.DistanceResult()) + max(0.0, allowed)
                least = min(least, found if allowed < 0.0 or found < 0.0 else np.inf)
    return least


if __name__ == "__main__":
    for name in sys.argv[1:]:
        found = check(Path(name))
        distance = 1e3 * distance_by_coal(Path(name))
        print(f"{name}: {'fail: ' + '; '.join(found) if found else 'pass'}; tool and payload {distance:.2f} mm apart")

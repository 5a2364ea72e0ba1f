"""Drive exported designs in MuJoCo, independent of armwright: `check_simulation.py RUN/designs/NNNN ...`.

Reads arm.xml and trajectory.csv of each folder, and prints its verdict by the rules of docs/method.md: every dwell ends
within the target's tolerance, nothing touches, and no joint is at its torque limit for more than 2 % of the cycle. Tool
and payload are bodies, which may be as deep in obstacles as the trajectory allows.
"""

import csv
import sys
from pathlib import Path

import mujoco
import numpy as np

SHARE, NOTHING = 0.02, 1e-9


def check(folder: Path) -> list[str]:
    """Return why a design fails; nothing if it passes."""
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.xml"))
    data = mujoco.MjData(model)
    with (folder / "trajectory.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    n = model.nu // 2
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


if __name__ == "__main__":
    for name in sys.argv[1:]:
        found = check(Path(name))
        print(f"{name}: {'fail: ' + '; '.join(found) if found else 'pass'}")

"""The model and trajectory of an arm for evaluators."""

import mujoco
import numpy as np
import pytest

import armwright as aw
from armwright.exceptions import SettingsError
from armwright.problem.objectives import QUANTITIES
from armwright.proof.simulated_run import simulate_arm

TASK, SPACE = aw.load_task("desk-sorting"), aw.load_space("desk-sorting")


@pytest.mark.slow
def test_cycle_model_is_what_a_simulation_of_the_run_drives() -> None:
    problem = aw.Problem(TASK, SPACE)
    sampled = SPACE.sample(100, 0)
    durations = QUANTITIES["cycle_time"](problem.physics(sampled))
    designs = [sampled[row] for row in np.argsort(durations)[:3]]  # weak motors may take days
    evaluation = problem.physics(designs)
    for row, design in enumerate(designs):
        arm = problem.arm(design)
        model = aw.cycle_model(arm, TASK)
        member = simulate_arm(problem, arm, evaluation, row, row)
        assert model.trajectory.q == pytest.approx(member.trajectory.q, abs=1e-8)
        assert model.trajectory.time == pytest.approx(member.trajectory.time)
        loaded, other = (mujoco.MjModel.from_xml_string(xml) for xml in (model.mjcf, member.files["arm.xml"]))
        assert np.array_equal(loaded.body_mass, other.body_mass)


def test_cycle_model_needs_a_cycle() -> None:
    with pytest.raises(SettingsError, match="task target-1 has no cycle; try cycle: in_order"):
        aw.cycle_model(aw.paper_space().arm(aw.paper_space().sample(1, 0)[0]), aw.load_task("target-1"))

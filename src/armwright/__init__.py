"""Which arm should I build for this task?

import armwright as aw

problem = aw.Problem(task=aw.load_task("target-1"), space=aw.paper_space(joints=4))
run = aw.optimize(problem, proposer="rules", n_total=200, seed=0, out="runs/mine")
print(run.hypervolume[-1], aw.to_urdf(run.front[0].arm))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armwright.exceptions import ArmwrightError, FailureError, ProposalError, UsageError
    from armwright.experiments.compare_arms import ArmComparison, ComparedArm, compare_arms
    from armwright.experiments.compare_runs import Comparison, compare_runs
    from armwright.llm.draft import Draft, draft
    from armwright.llm.model_options import ModelOptions, PromptOptions
    from armwright.pareto import hypervolume
    from armwright.problem.evaluation import Evaluation, evaluate
    from armwright.problem.evaluators import Evaluator, evaluator, load_evaluator
    from armwright.problem.problem import Problem
    from armwright.proposers.for_optuna.callback import ProposalCallback
    from armwright.proposers.for_optuna.llm import StudyLlmProposer
    from armwright.proposers.for_optuna.proposer import StudyProposal, StudyProposer
    from armwright.proposers.for_optuna.rules import StudyRulesProposer
    from armwright.proposers.llm import LlmProposer
    from armwright.proposers.manual import ManualProposer
    from armwright.proposers.proposer import Proposal, Proposer
    from armwright.proposers.replay import ReplayProposer
    from armwright.proposers.rules import RulesProposer
    from armwright.report.figures import write_figures
    from armwright.report.page import write_report
    from armwright.robot.arm import Arm, Joint, Link, uniform_link
    from armwright.robot.mjcf import to_mjcf
    from armwright.robot.ros2_control import to_ros2_control
    from armwright.robot.sdf import to_sdf
    from armwright.robot.srdf import to_srdf
    from armwright.robot.urdf_reader import UrdfArm, read_urdf
    from armwright.robot.urdf_writer import to_urdf
    from armwright.robot.xacro import to_xacro
    from armwright.runs.folder import read_run
    from armwright.runs.history import FrontMember, History
    from armwright.runs.results import verify_run
    from armwright.runs.trial import FinishedTrial
    from armwright.spaces.design_space import DesignSpace, load_space, paper_space
    from armwright.spaces.parameters import Design
    from armwright.study.cluster import Workers
    from armwright.study.front_run import FrontRun, find_front
    from armwright.study.progress import StudyResult
    from armwright.study.refine_run import refine_run
    from armwright.study.study import optimize
    from armwright.tasks.catalogue import builtin_tasks, load_task, random_task
    from armwright.tasks.task import Task

# Where each public name lives. Modules load when a name of theirs is first used, so that the command line
# answers at once and nobody pays for what is not used.
_PLACES = {
    "Arm": "robot.arm",
    "ArmComparison": "experiments.compare_arms",
    "ArmwrightError": "exceptions",
    "ComparedArm": "experiments.compare_arms",
    "Comparison": "experiments.compare_runs",
    "Design": "spaces.parameters",
    "DesignSpace": "spaces.design_space",
    "Draft": "llm.draft",
    "Evaluation": "problem.evaluation",
    "Evaluator": "problem.evaluators",
    "FailureError": "exceptions",
    "FinishedTrial": "runs.trial",
    "FrontMember": "runs.history",
    "FrontRun": "study.front_run",
    "History": "runs.history",
    "Joint": "robot.arm",
    "Link": "robot.arm",
    "LlmProposer": "proposers.llm",
    "ManualProposer": "proposers.manual",
    "ModelOptions": "llm.model_options",
    "Problem": "problem.problem",
    "PromptOptions": "llm.model_options",
    "Proposal": "proposers.proposer",
    "ProposalCallback": "proposers.for_optuna.callback",
    "ProposalError": "exceptions",
    "Proposer": "proposers.proposer",
    "ReplayProposer": "proposers.replay",
    "RulesProposer": "proposers.rules",
    "StudyResult": "study.progress",
    "StudyLlmProposer": "proposers.for_optuna.llm",
    "StudyProposal": "proposers.for_optuna.proposer",
    "StudyProposer": "proposers.for_optuna.proposer",
    "StudyRulesProposer": "proposers.for_optuna.rules",
    "Task": "tasks.task",
    "UrdfArm": "robot.urdf_reader",
    "UsageError": "exceptions",
    "Workers": "study.cluster",
    "builtin_tasks": "tasks.catalogue",
    "compare_arms": "experiments.compare_arms",
    "compare_runs": "experiments.compare_runs",
    "draft": "llm.draft",
    "evaluate": "problem.evaluation",
    "evaluator": "problem.evaluators",
    "find_front": "study.front_run",
    "hypervolume": "pareto",
    "load_evaluator": "problem.evaluators",
    "load_space": "spaces.design_space",
    "load_task": "tasks.catalogue",
    "optimize": "study.study",
    "paper_space": "spaces.design_space",
    "refine_run": "study.refine_run",
    "random_task": "tasks.catalogue",
    "read_run": "runs.folder",
    "read_urdf": "robot.urdf_reader",
    "to_mjcf": "robot.mjcf",
    "to_ros2_control": "robot.ros2_control",
    "to_sdf": "robot.sdf",
    "to_srdf": "robot.srdf",
    "to_urdf": "robot.urdf_writer",
    "to_xacro": "robot.xacro",
    "uniform_link": "robot.arm",
    "verify_run": "runs.results",
    "write_figures": "report.figures",
    "write_report": "report.page",
}

__all__ = [
    "Arm",
    "ArmComparison",
    "ArmwrightError",
    "ComparedArm",
    "Comparison",
    "Design",
    "DesignSpace",
    "Draft",
    "Evaluation",
    "Evaluator",
    "FailureError",
    "FinishedTrial",
    "FrontMember",
    "FrontRun",
    "History",
    "Joint",
    "Link",
    "LlmProposer",
    "ManualProposer",
    "ModelOptions",
    "Problem",
    "PromptOptions",
    "Proposal",
    "ProposalCallback",
    "ProposalError",
    "Proposer",
    "ReplayProposer",
    "RulesProposer",
    "StudyLlmProposer",
    "StudyProposal",
    "StudyProposer",
    "StudyResult",
    "StudyRulesProposer",
    "Task",
    "UrdfArm",
    "UsageError",
    "Workers",
    "builtin_tasks",
    "compare_arms",
    "compare_runs",
    "draft",
    "evaluate",
    "evaluator",
    "find_front",
    "hypervolume",
    "load_evaluator",
    "load_space",
    "load_task",
    "optimize",
    "paper_space",
    "random_task",
    "read_run",
    "read_urdf",
    "refine_run",
    "to_mjcf",
    "to_ros2_control",
    "to_sdf",
    "to_srdf",
    "to_urdf",
    "to_xacro",
    "uniform_link",
    "verify_run",
    "write_figures",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module 'armwright' has no attribute {name!r}")
    return getattr(import_module(f"armwright.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return __all__

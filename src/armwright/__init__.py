"""Which arm should I build for this task?

import armwright as aw

problem = aw.Problem(task=aw.load_task("target-1"), space=aw.paper_space(joints=4))
run = aw.optimize(problem, proposer="rules", n_total=200, seed=0, out="runs/mine")
print(run.hypervolume[-1], aw.to_urdf(run.front[0].arm))
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armwright.any_study.callback import ProposalCallback
    from armwright.any_study.llm import StudyLlmProposer
    from armwright.any_study.proposals import StudyProposal, StudyProposer
    from armwright.any_study.rules import StudyRulesProposer
    from armwright.arm import Arm, Joint, Link, uniform_link
    from armwright.buying import ArmComparison, ComparedArm, compare_arms
    from armwright.cluster import Workers
    from armwright.comparison import Comparison, compare_runs
    from armwright.drafting import Draft, draft
    from armwright.evaluation import Evaluation, evaluate
    from armwright.exceptions import ArmwrightError, FailureError, ProposalError, UsageError
    from armwright.export.mjcf import to_mjcf
    from armwright.export.ros2_control import to_ros2_control
    from armwright.export.sdf import to_sdf
    from armwright.export.srdf import to_srdf
    from armwright.export.urdf import to_urdf
    from armwright.export.xacro import to_xacro
    from armwright.front import FrontRun, find_front
    from armwright.history import FrontMember, History
    from armwright.measuring import Evaluator, evaluator, load_evaluator
    from armwright.parameters import Design
    from armwright.pareto import hypervolume
    from armwright.polish import polish_run
    from armwright.problem import Problem
    from armwright.proposers.llm import LlmProposer
    from armwright.proposers.manual import ManualProposer
    from armwright.proposers.proposer import Proposal, Proposer
    from armwright.proposers.replay import ReplayProposer
    from armwright.proposers.rules import RulesProposer
    from armwright.report.figures import write_figures
    from armwright.report.page import write_report
    from armwright.results import verify_run
    from armwright.run_folder import read_run
    from armwright.space import DesignSpace, load_space, paper_space
    from armwright.study import Run, optimize
    from armwright.task import Task, builtin_tasks, load_task, random_task
    from armwright.trial import FinishedTrial
    from armwright.urdf.reading import UrdfArm, read_urdf

# Where each public name lives. Modules load when a name of theirs is first used, so that the command line
# answers at once and nobody pays for what is not used.
_PLACES = {
    "Arm": "arm",
    "ArmComparison": "buying",
    "ArmwrightError": "exceptions",
    "ComparedArm": "buying",
    "Comparison": "comparison",
    "Design": "parameters",
    "DesignSpace": "space",
    "Draft": "drafting",
    "Evaluation": "evaluation",
    "Evaluator": "measuring",
    "FailureError": "exceptions",
    "FinishedTrial": "trial",
    "FrontMember": "history",
    "FrontRun": "front",
    "History": "history",
    "Joint": "arm",
    "Link": "arm",
    "LlmProposer": "proposers.llm",
    "ManualProposer": "proposers.manual",
    "Problem": "problem",
    "Proposal": "proposers.proposer",
    "ProposalCallback": "any_study.callback",
    "ProposalError": "exceptions",
    "Proposer": "proposers.proposer",
    "ReplayProposer": "proposers.replay",
    "RulesProposer": "proposers.rules",
    "Run": "study",
    "StudyLlmProposer": "any_study.llm",
    "StudyProposal": "any_study.proposals",
    "StudyProposer": "any_study.proposals",
    "StudyRulesProposer": "any_study.rules",
    "Task": "task",
    "UrdfArm": "urdf.reading",
    "UsageError": "exceptions",
    "Workers": "cluster",
    "builtin_tasks": "task",
    "compare_arms": "buying",
    "compare_runs": "comparison",
    "draft": "drafting",
    "evaluate": "evaluation",
    "evaluator": "measuring",
    "find_front": "front",
    "hypervolume": "pareto",
    "load_evaluator": "measuring",
    "load_space": "space",
    "load_task": "task",
    "optimize": "study",
    "paper_space": "space",
    "polish_run": "polish",
    "random_task": "task",
    "read_run": "run_folder",
    "read_urdf": "urdf.reading",
    "to_mjcf": "export.mjcf",
    "to_ros2_control": "export.ros2_control",
    "to_sdf": "export.sdf",
    "to_srdf": "export.srdf",
    "to_urdf": "export.urdf",
    "to_xacro": "export.xacro",
    "uniform_link": "arm",
    "verify_run": "results",
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
    "Problem",
    "Proposal",
    "ProposalCallback",
    "ProposalError",
    "Proposer",
    "ReplayProposer",
    "RulesProposer",
    "Run",
    "StudyLlmProposer",
    "StudyProposal",
    "StudyProposer",
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
    "polish_run",
    "random_task",
    "read_run",
    "read_urdf",
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

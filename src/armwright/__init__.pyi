# The public names, listed once. A module is imported when one of its names is first used.

from .exceptions import (
    ArmwrightError as ArmwrightError,
    FailureError as FailureError,
    ProposalError as ProposalError,
    UsageError as UsageError,
)
from .existing.compare_arms import (
    ArmComparison as ArmComparison,
    ComparedArm as ComparedArm,
    compare_arms as compare_arms,
)
from .experiments.compare_runs import Comparison as Comparison, compare_runs as compare_runs
from .kinematics.reach.reach_map import PoseCoverage as PoseCoverage, ReachMap as ReachMap, reach_map as reach_map
from .kinematics.ik.solve import Solutions as Solutions, solve as solve
from .llm.draft import Draft as Draft, draft as draft
from .llm.model_options import ModelOptions as ModelOptions, PromptOptions as PromptOptions
from .pareto import hypervolume as hypervolume
from .problem.evaluation import Evaluation as Evaluation, evaluate as evaluate
from .problem.evaluators import Evaluator as Evaluator, evaluator as evaluator, load_evaluator as load_evaluator
from .problem.problem import Problem as Problem
from .proposers.for_optuna.callback import ProposalCallback as ProposalCallback
from .proposers.for_optuna.llm import StudyLlmProposer as StudyLlmProposer
from .proposers.for_optuna.proposer import StudyProposal as StudyProposal, StudyProposer as StudyProposer
from .proposers.for_optuna.rules import StudyRulesProposer as StudyRulesProposer
from .proposers.llm import LlmProposer as LlmProposer
from .proposers.manual import ManualProposer as ManualProposer
from .proposers.proposer import Proposal as Proposal, Proposer as Proposer
from .proposers.replay import ReplayProposer as ReplayProposer
from .proposers.rules import RulesProposer as RulesProposer
from .pictures.figures import write_figures as write_figures
from .page.page import write_report as write_report
from .robot.arm import Arm as Arm, Joint as Joint, Link as Link, uniform_link as uniform_link
from .robot.ros2_control import to_ros2_control as to_ros2_control
from .robot.urdf_reader import UrdfArm as UrdfArm, read_urdf as read_urdf
from .robot.urdf_writer import to_urdf as to_urdf
from .proof.cycle_export import CycleModel as CycleModel, cycle_model as cycle_model
from .runs.folder import read_run as read_run
from .runs.history import FrontMember as FrontMember, History as History
from .proof.task_mjcf import to_mjcf as to_mjcf
from .runs.trial import FinishedTrial as FinishedTrial
from .search.surrogate.sampler import surrogate_sampler as surrogate_sampler
from .spaces.design_space import DesignSpace as DesignSpace, load_space as load_space, paper_space as paper_space
from .spaces.parameters import Design as Design
from .study.workers.cluster import Workers as Workers
from .study.front.direct_search import FrontRun as FrontRun
from .study.front.front_run import find_front as find_front
from .study.progress import StudyResult as StudyResult
from .study.study import optimize as optimize
from .tasks.catalogue import builtin_tasks as builtin_tasks, load_task as load_task, random_task as random_task
from .tasks.task import Task as Task

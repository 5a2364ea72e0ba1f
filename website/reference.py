"""The reference pages of the guide, made from the code."""

from collections.abc import Callable, Mapping, Sequence

import armwright
from armwright.catalogue import ActuatorRecord, catalogue
from armwright.constraints import QUANTITIES
from armwright.experiment.plan import ExperimentPlan, FigurePlan, MethodPlan, builtin_experiments
from armwright.llm.configuration import _ConfigurationFile  # pyright: ignore[reportPrivateUsage]
from armwright.masses import MassOfTube, MassPerLink, MassPerMetre
from armwright.modules import JOINT_WORDS, MOUNT_WORDS
from armwright.objectives import MOST_OBJECTIVES, OBJECTIVES
from armwright.obstacles import Box, Cylinder, Ground, Sphere
from armwright.space import DesignSpace
from armwright.starts import DesignFile
from armwright.targets import Target
from armwright.task import Task
from armwright.workspace import Region
from website import commands, keys

OVER = {
    "sum": "sum over the targets", "max": "largest over the targets", "min": "least over the targets",
    "mean square": "root of the mean square over the targets", "arm": "of the arm",
}  # fmt: skip
PYTHON: Mapping[str, Sequence[str]] = {
    "The problem": ("Task", "load_task", "builtin_tasks", "random_task", "DesignSpace", "load_space", "paper_space",
                    "Design", "Problem"),
    "The search": ("optimize", "Run", "find_front", "FrontRun", "polish_run", "verify_run", "History",
                   "FinishedTrial", "FrontMember", "hypervolume"),
    "Evaluators and workers": ("Evaluator", "evaluator", "load_evaluator", "Workers", "work"),
    "Arms": ("Arm", "Joint", "Link", "uniform_link", "read_urdf", "UrdfArm", "evaluate", "Evaluation"),
    "Exports": ("to_urdf", "to_mjcf", "to_sdf", "to_xacro", "to_srdf", "to_ros2_control"),
    "Runs and comparisons": ("read_run", "write_figures", "write_report", "compare_runs", "Comparison",
                             "compare_arms", "ArmComparison", "ComparedArm"),
    "Proposers": ("Proposer", "Proposal", "RulesProposer", "LlmProposer", "ReplayProposer", "ManualProposer",
                  "draft", "Draft"),
    "Any Optuna study": ("ProposalCallback", "StudyProposer", "StudyProposal", "StudyLlmProposer",
                         "StudyRulesProposer"),
    "Errors": ("ArmwrightError", "UsageError", "FailureError", "ProposalError"),
}  # fmt: skip


def pages() -> dict[str, Callable[[], str]]:
    """What makes each page, by its path."""
    return {
        "reference/cli.md": commands.page,
        "reference/task.md": task_page,
        "reference/space.md": space_page,
        "reference/experiment.md": experiment_page,
        "reference/files.md": files_page,
        "reference/python.md": python_page,
    }


def task_page() -> str:
    """Task files, and the names of what is minimised or bounded."""
    words = (
        "What `armwright optimize` and all other commands take as TASK; `armwright init` writes one to edit. How it is "
        "used: [tasks](../tasks.md); how everything is computed: [method](../method.md)."
    )
    rows = [f"| `{o.name}` | {o.unit} | {OVER[o.over]} | {keys.cell(o.words)} |" for o in OBJECTIVES.values()]
    bounded = [q for name, q in QUANTITIES.items() if name not in OBJECTIVES]
    more = [f"| `{q.name}` | {q.unit} | {OVER[q.over]} | {keys.cell(q.words)} |" for q in bounded]
    head = ["| name | unit | | |", "|---|---|---|---|"]
    return "\n\n".join(
        [
            keys.page("Task files", words, [Task, Target, Region, Box, Sphere, Cylinder, Ground]).rstrip(),
            f"## Objectives\n\nAll are minimised; one to {MOST_OBJECTIVES} of them. The last column is what is taken "
            "at each target.",
            "\n".join([*head, *rows]),
            "Constraints bound any of these, and besides:",
            "\n".join([*head, *more]),
        ]
    )


def space_page() -> str:
    """Space files, joint modules, mounts and the catalogue of actuators."""
    words = "What `--space` takes. How it is used: [design spaces](../spaces.md)."
    modules = [f"| `{letter}` | {words} |" for letter, words in JOINT_WORDS.items()]
    mounts = [f"| `{mount}` | {words} |" for mount, words in MOUNT_WORDS.items()]
    models = [DesignSpace, MassPerMetre, MassPerLink, MassOfTube, ActuatorRecord]
    return "\n\n".join(
        [
            keys.page("Space files", words, models).rstrip(),
            "## Joint modules",
            "\n".join(["| letter | |", "|---|---|", *modules]),
            "## Mounts",
            "\n".join(["| mount | |", "|---|---|", *mounts]),
            "## The catalogue of actuators",
            _catalogue(),
        ]
    )


def _catalogue() -> str:
    rows = [
        f"| `{r.name}` | {r.maker} | {_number(r.mass)} | {_number(r.stall_torque)} | {_number(r.rated_torque)} "
        f"| {_number(r.peak_torque)} | {_number(r.speed)} | {_number(r.price)} |"
        for r in catalogue().values()
    ]
    head = "| name | maker | mass [kg] | stall [N m] | rated [N m] | peak [N m] | speed [rad/s] | price [USD] |"
    return "\n".join([head, "|---|---|--:|--:|--:|--:|--:|--:|", *rows])


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def experiment_page() -> str:
    """Experiment files, and those that are built in."""
    words = (
        "What `armwright experiment` takes beside the built-in ones, which `--print` prints. How it is used: "
        "[experiments](../experiments.md)."
    )
    rows = [f"| `{plan.name}` | {keys.cell(plan.description)} |" for plan in builtin_experiments().values()]
    table = "\n".join(["| built in | |", "|---|---|", *rows])
    models = [ExperimentPlan, MethodPlan, FigurePlan]
    return keys.page("Experiment files", words, models) + f"\n## Built in\n\n{table}\n"


def files_page() -> str:
    """A design to begin with, and the configuration."""
    words = (
        "A design to begin with (`--start`), as YAML or JSON, and the configuration of the language model, "
        "`~/.config/armwright/config.yaml` on Linux (`armwright doctor` says where)."
    )
    return keys.page("Other files", words, [DesignFile, _ConfigurationFile])


def python_page() -> str:
    """Every public name, once; ValueError for one that has no place here."""
    placed = [name for names in PYTHON.values() for name in names]
    if sorted(placed) != sorted(armwright.__all__):
        raise ValueError(f"website/reference.py: not placed, or twice: {set(placed) ^ set(armwright.__all__)}")
    parts = [
        "# Python",
        "All of it is reached by `import armwright as aw`. Units stand in brackets, shapes in parentheses.",
    ]
    for title, names in PYTHON.items():
        parts.append(f"## {title}")
        parts += [f"::: {getattr(armwright, name).__module__}.{name}" for name in names]
    return "\n\n".join(parts) + "\n"

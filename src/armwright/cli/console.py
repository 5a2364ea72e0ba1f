"""Everything that commands print, under one name."""

from armwright.cli.progress import search_progress as searching
from armwright.cli.progress import study_progress as watching
from armwright.cli.show_comparisons import (
    notes_on_cells,
    show_arms,
    show_comparison,
    show_files,
    show_outcome,
    show_plan,
)
from armwright.cli.show_inputs import show_actuators, show_draft, show_task, show_tasks
from armwright.cli.show_results import show_front, show_picked, show_polish, show_result, show_runs, show_search
from armwright.cli.streams import stderr_console, stdout_console

__all__ = [
    "notes_on_cells", "searching", "show_actuators", "show_arms", "show_comparison", "show_draft", "show_files",
    "show_front", "show_outcome", "show_picked", "show_plan", "show_polish", "show_result", "show_runs", "show_search",
    "show_task", "show_tasks", "stderr_console", "stdout_console", "watching",
]  # fmt: skip

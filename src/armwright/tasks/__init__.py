"""Tasks: targets, tool, cycle, obstacles, workspace and the built-in tasks."""

"""Tasks: targets, moves, obstacles, workspace and the built-in tasks."""

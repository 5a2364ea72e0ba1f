"""What the arm is for: targets, moves, obstacles, workspace and the built-in tasks."""

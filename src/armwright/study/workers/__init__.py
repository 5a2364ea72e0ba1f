"""Where evaluations run, and what happens when they fail."""

"""A vectorised multi-objective search for problems that evaluate a great many designs at once."""

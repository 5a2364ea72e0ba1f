"""The data sheet of a design or of an existing arm."""

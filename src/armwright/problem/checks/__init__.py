"""Checks of a task and a design space before a search: what cannot work, and what was probably not meant."""

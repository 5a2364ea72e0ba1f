"""Algorithms that generate designs: Optuna samplers, front search and refinement."""

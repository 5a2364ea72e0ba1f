"""Algorithms that generate designs: Optuna samplers and the front search."""

"""Proposals for any Optuna study."""

"""Proposals for any Optuna study: a callback of `study.optimize`, and a language model that is told of the study."""

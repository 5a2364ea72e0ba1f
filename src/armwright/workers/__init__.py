"""Designs evaluated by worker processes, for evaluators that take their time.

board.py     the Optuna study that a search and its workers share: designs are posted there, values come back
judging.py   the search's side
worker.py    the worker's side: `armwright worker RUN`
"""

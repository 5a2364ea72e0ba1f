"""Fuzzing: randomly mutated documents are read or refused, never mishandled.

python -m tests.fuzz --help      # or make fuzz
"""

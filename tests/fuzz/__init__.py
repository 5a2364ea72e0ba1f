"""Fuzzing: randomly mutated documents are read or refused, never mishandled."""

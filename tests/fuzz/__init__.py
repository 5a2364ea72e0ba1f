"""Input that somebody made up: valid documents changed at random, and what has to come of each.

python -m tests.fuzz --help      # or make fuzz
"""

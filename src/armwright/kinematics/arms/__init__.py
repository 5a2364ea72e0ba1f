"""Arms in arrays: chains, bodies, drives; where their joints are."""

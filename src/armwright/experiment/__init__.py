"""Experiments: methods on tasks with seeds, each cell an ordinary run folder."""

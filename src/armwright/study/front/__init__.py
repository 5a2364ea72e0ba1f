"""The loop of a direct search."""

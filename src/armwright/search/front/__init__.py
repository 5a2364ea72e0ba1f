"""The direct search for a front."""

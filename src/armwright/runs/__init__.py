"""A run: its trials, its folder on disk, and everything derived from them."""

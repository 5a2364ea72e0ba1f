"""One data sheet of one arm."""

"""A design in, objective and constraint values out."""

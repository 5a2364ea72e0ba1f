"""Distances of links, motors and columns from each other and from obstacles."""

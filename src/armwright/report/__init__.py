"""Presentation of a run: figures, tables, the page and the live server."""

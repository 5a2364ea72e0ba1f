"""One HTML file that shows a run, finished or running."""

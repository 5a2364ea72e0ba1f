"""A local page on which a task and a design space are drawn, checked and searched."""

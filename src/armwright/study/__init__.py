"""The search loop: schedule, evaluation backends and resumption."""
